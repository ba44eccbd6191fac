// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

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
  Graph graph = {};  ///< the recording at its minimum, without the factors that are left out
  double chi2 = 0.0;
  /// Loop closures that contradict the others, by position in the recording, rising.
  std::vector<int> left_out = {};
};

/// Whether what matches in a run is what was recorded: its registration is `recorded`, without
/// false matches. Of others a recording is no measure.
CAIRN_API bool matches_as_recorded(const PolicyJob& job);

/// Optimises all measurements of a recording, from what the initial guess `auto` makes of it. Where
/// chi2 is larger than chance allows and factors have no losses of their own, loop closures may be
/// wrong: by the loss `geman_mcclure` on them, those are left out to which it leaves less than one
/// per cent of their weight and whose squared residual is more than 50 times chi2 of the others per
/// degree of freedom (where that is below one, 50). Not where these are more than a third of all, or
/// where they explain less than half of what chi2 per degree of freedom is above one. There is no
/// estimate where the minimum is not found, or not plausible (`is_plausible`).
CAIRN_API EstimateOfAll estimate_of_all(const PolicySetting& setting);

/// The data without some factors, by position.
CAIRN_API PolicyData without_factors(PolicyData data, std::span<const int> factors);

/// "12 of 1439 loop closures contradict the others and are left out, the first from pose 3 to pose
/// 507"; empty where there are none.
CAIRN_API std::string left_out_in_words(const EstimateOfAll& all, const PolicyData& data);

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

/// Compares the trajectory of a run with `estimate_of_all`. Nothing where there is none, where the
/// run was interrupted or continued another map, or where matches were not those recorded.
CAIRN_API std::optional<MapCheck> check_map(const PolicyJob& job, const PolicyResult& result,
                                            const PolicySetting& setting);

}  // namespace cairn
