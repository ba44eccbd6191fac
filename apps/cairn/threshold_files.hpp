// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/plugin/options.hpp"

namespace cairn::app {

/// Thresholds that `write_thresholds` wrote. Throws `Error` (input) for those of another policy.
OptionValues read_thresholds(const std::string& file, const std::string& policy);
void write_thresholds(const std::string& file, const std::string& policy,
                      const OptionValues& options);

}  // namespace cairn::app
