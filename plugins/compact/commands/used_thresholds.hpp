// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "cairn/plugin/options.hpp"

namespace cairn::app {

/// The thresholds with which `cairn compact` runs a policy.
struct UsedThresholds {
  OptionValues options;  ///< given, found in a sample, or read from a file
  /// By name, those of `options` that the command line gives: neither a search nor a file changes
  /// them.
  std::set<std::string, std::less<>> given;
  /// Those of the command line's thresholds that are none of these: values of the policy itself.
  OptionValues defaults;
};

/// `given` are the policy's options on the command line, `found` those of a search or a file, and
/// `table` all that the policy has. A threshold is an option that is a real number, or that was
/// found.
UsedThresholds used_thresholds(const OptionValues& given, const OptionValues& found,
                               const OptionTable& table);

/// One after the other, each with where it comes from unless it was found or read:
/// "angle 0.5 (default), loop_gain 1 (given), range 2.4".
std::string thresholds_line(const UsedThresholds& thresholds);

/// Of the defaults those for which a policy of this strategy has a use, and which a search would
/// replace: "range, angle and pose_gain"; empty: there are none.
std::string replaceable_defaults(const UsedThresholds& thresholds, const std::string& strategy);

}  // namespace cairn::app
