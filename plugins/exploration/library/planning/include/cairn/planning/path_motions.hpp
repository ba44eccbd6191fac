// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/exploration/path_planner.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// The motions that `next_motion` makes of a path for a robot that carries them out exactly, each
/// in the frame of the pose before: as many as there will be SLAM steps. A path that a robot of
/// `MotionModel::dubins` can't follow by steering, since its curve is not known yet, has those of a
/// robot that turns in place.
CAIRN_API std::vector<Pose2> motions_along(const Pose2& from, const PlannedPath& path,
                                           const RobotModel& robot);

}  // namespace cairn
