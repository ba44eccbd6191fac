// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace cairn::app {

/// The largest resident size of this process so far [bytes].
std::int64_t peak_memory_bytes();

/// Runs this program again with other arguments, in a process of its own, and returns what it wrote
/// to standard output (its standard error is dropped); nothing if it could not be run or did not
/// exit by itself. Once `interrupt` is true, that process is asked to end (SIGTERM).
std::optional<std::string> output_of_self(const std::vector<std::string>& arguments,
                                          const std::atomic<bool>& interrupt);

}  // namespace cairn::app
