// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cairn/api.hpp"
#include "cairn/graph.hpp"

namespace cairn {

/// A pose in 3D, whatever the graph's dimension (a planar pose lies in z = 0).
struct TrajectoryPose {
  Id id = 0;
  std::array<double, 3> t{};                           ///< position [m]
  std::array<double, 9> R{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< rotation body → world, column-major
};

/// Poses by rising id.
using Trajectory = std::vector<TrajectoryPose>;

/// All poses of a graph (variables with orientation), by rising id.
CAIRN_API Trajectory trajectory(const Graph& graph);

/// Root mean squares of errors of an estimate against the truth.
struct TrajectoryError {
  std::int64_t poses = 0;            ///< compared: ids in both
  double ate_translation = 0.0;      ///< absolute, after rigid alignment [m]
  double ate_rotation = 0.0;         ///< [deg]
  double rpe_translation = 0.0;      ///< relative, between consecutive poses [m]
  double rpe_rotation = 0.0;         ///< [deg]
  double rpe_all_translation = 0.0;  ///< relative, over all pairs [m]
  double rpe_all_rotation = 0.0;     ///< [deg]
};

/// Compares poses of equal id after the rigid motion (Kabsch, no scale) that brings `estimate`
/// nearest to `truth`. All-to-all errors go over all n(n-1)/2 pairs. Throws `Error` (input) if
/// fewer than two poses are in both.
CAIRN_API TrajectoryError compare(const Trajectory& estimate, const Trajectory& truth);

}  // namespace cairn
