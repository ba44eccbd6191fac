// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What all measurements of a recording say, which is the measure of a map of some of them. No
/// truth is needed for that.
struct EstimateOfAll {
  /// Empty: there is an estimate. Else why not: a sentence without its full stop.
  std::string why_not = {};
  Graph graph = {};  ///< the recording at its minimum
  double chi2 = 0.0;
};

/// Whether what matches in a run is what was recorded: its registration is `recorded`, without
/// false matches. Of others a recording is no measure.
CAIRN_API bool matches_as_recorded(const PolicyJob& job);

/// Optimises all measurements of the recording, from the trajectory of a run and what the initial
/// guess `auto` makes of it. There is no such estimate where the run was interrupted or continued
/// another map, where matches are not those that were recorded, where some were found to be
/// inconsistent, which the map of all measurements is not without, or where the minimum of all
/// measurements is not plausible or not found.
CAIRN_API EstimateOfAll estimate_of_all(const PolicyJob& job, const PolicyResult& result,
                                        const PolicySetting& setting);

/// How far a map is from that of all measurements.
struct MapCheck {
  double distance = 0.0;  ///< of its poses, after alignment, root mean square [m]
  double extent = 0.0;    ///< of the map of all measurements: the diagonal of the box around it [m]

  /// Whether more is lost than a reader of the map expects: more than half a per cent of its
  /// extent.
  bool is_far() const { return distance > 0.005 * extent; }
  /// "0.447 m from the map of all measurements, 0.65 % of its extent"
  CAIRN_API std::string to_string() const;
};

/// The diagonal of the box around the positions [m].
CAIRN_API double extent_of(const Trajectory& poses);

/// Compares the trajectory of a run with `estimate_of_all`; nothing where there is none.
CAIRN_API std::optional<MapCheck> check_map(const PolicyJob& job, const PolicyResult& result,
                                            const PolicySetting& setting);

}  // namespace cairn
