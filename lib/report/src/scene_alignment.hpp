// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "cairn/geometry/pose.hpp"
#include "cairn/report/scene.hpp"

namespace cairn {

/// The rigid motion that brings the poses of `estimate` nearest to those of `truth` (`align` of
/// evaluation/trajectory.hpp), both of `scene`; none where fewer than two poses are in both.
std::optional<Pose> motion_to(const SceneEstimate& truth, const SceneEstimate& estimate,
                              const Scene& scene);

/// Moves all of an estimate: positions, orientations and covariances of positions.
void move(SceneEstimate& estimate, const Scene& scene, const Pose& motion);
/// The same for the snapshots of a run, whose positions are relative to `Scene::origin`.
void move(Recording& recording, const Scene& scene, const Pose& motion);

}  // namespace cairn
