// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Where beams of a scan end that a round body would touch on a motion from where the scan was
/// taken, in the frame of that pose [m]; none: the way is clear as far as the scan shows.
/// What it touches already is no hindrance if it comes no nearer. Ranges err: a point within two
/// standard deviations of them of the body's edge, up to half its radius, is not touched. A robot
/// of `MotionModel::dubins` drives along an arc, others straight.
CAIRN_API std::vector<Eigen::Vector2d> touched_points(const LaserScan& scan, const Pose2& motion,
                                                      const RobotModel& robot);

/// A motion with which the body passes beside what it would touch on another one: as long, or
/// half as long, and up to 30° to a side. None: there is no such motion, or the robot can't turn in
/// place.
CAIRN_API std::optional<Pose2> motion_beside(const LaserScan& scan, const Pose2& motion,
                                             const RobotModel& robot);

}  // namespace cairn
