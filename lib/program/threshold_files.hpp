// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "cairn/plugin/options.hpp"

namespace cairn::app {

struct SavedThresholds {
  OptionValues options = {};
  std::int64_t poses = 0;  ///< of the sample in which they were found; 0: not known
};

/// What `write_thresholds` wrote. Throws `Error` (input) for thresholds of another policy.
SavedThresholds read_thresholds(const std::string& file, const std::string& policy);
void write_thresholds(const std::string& file, const std::string& policy,
                      const SavedThresholds& thresholds);

}  // namespace cairn::app
