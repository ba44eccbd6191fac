// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/policy/policy_run.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// How far the map of a recording is from that of all its measurements, which it stands for. No
/// truth is needed for that.
struct MapCheck {
  double distance = 0.0;  ///< of all poses, after alignment, root mean square [m]
  double extent = 0.0;    ///< of the map of all measurements: the diagonal of the box around it [m]

  /// Whether more is lost than a reader of the map expects: more than half a per cent of its
  /// extent.
  bool is_far() const { return distance > 0.005 * extent; }
  /// "0.447 m from the map of all measurements, 0.65 % of its extent"
  CAIRN_API std::string to_string() const;
};

/// Optimises all measurements of the recording, from the trajectory of a run and what the initial
/// guess `auto` makes of it, and compares. No result where that map is no measure: the run
/// was interrupted or continued another map, matches were found to be inconsistent, which the map
/// of all measurements is not without, or the minimum of all measurements is not plausible or not
/// found. Nor where `job` has another registration than `recorded`, or one with false matches: what
/// matched is not what was recorded then.
CAIRN_API std::optional<MapCheck> check_map(const PolicyJob& job, const PolicyResult& result,
                                            const PolicySetting& setting);

}  // namespace cairn
