// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace cairn::app {

/// The largest resident size of this process so far [bytes].
std::int64_t peak_memory_bytes();

/// Runs this program again with other arguments, in a process of its own, and returns what it wrote
/// to standard output (its standard error is dropped); nothing if it could not be run or did not
/// exit by itself.
std::optional<std::string> output_of_self(const std::vector<std::string>& arguments);

}  // namespace cairn::app
