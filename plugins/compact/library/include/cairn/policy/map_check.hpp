// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/policy/estimate_of_all.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// How far a map is from that of all measurements.
struct MapCheck {
  double distance = 0.0;  ///< of its poses, after alignment, root mean square [m]
  double extent = 0.0;    ///< of the map of all measurements: the diagonal of the box around it [m]

  /// Whether more is lost than a reader of the map expects: more than half a per cent of its
  /// extent.
  bool is_far() const { return distance > 0.005 * extent; }
  /// "0.447 m from the map of all measurements, 0.65 % of its extent"
  CAIRN_API std::string to_string() const;

  CAIRN_API static ResultFields<MapCheck> fields();
};

/// The diagonal of the box around the positions [m].
CAIRN_API double extent_of(const Trajectory& poses);

/// Compares the trajectory of a run with `estimate_of_all`. Nothing where there is none, where the
/// run was interrupted or continued another map, or where matches were not those recorded.
CAIRN_API std::optional<MapCheck> check_map(const PolicyJob& job, const PolicyResult& result,
                                            const PolicySetting& setting);

}  // namespace cairn
