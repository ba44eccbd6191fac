// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "cairn/plugin/options.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// The thresholds of a policy, as options of it.
struct SavedThresholds {
  OptionValues options = {};
  std::int64_t poses = 0;  ///< of the sample in which they were found; 0: not known
};

/// What `cairn compact --save-thresholds` has written: {"policy", "options", "poses"}. Throws
/// `Error` (input) for what is none, or thresholds of another policy.
CAIRN_API SavedThresholds read_thresholds(const std::string& file, const std::string& policy);

}  // namespace cairn
