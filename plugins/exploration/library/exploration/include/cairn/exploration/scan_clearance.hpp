// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// Where the beams of a scan end that have met something, in the frame of the pose where it was
/// taken [m].
CAIRN_API std::vector<Eigen::Vector2d> beam_ends(const LaserScan& scan);

/// Which of the points where beams have ended, in the robot's frame, a round body would touch on a
/// motion [m]; none: the way is clear as far as they show. What it touches already is no hindrance
/// if it comes no nearer. An edge between two beams may be nearer than either by the distance
/// between them, of which up to 1 cm is kept clear. Ranges err: a point within two standard
/// deviations of them of the body's edge, up to half its radius, is not touched. A robot of
/// `MotionModel::dubins` drives along an arc, others straight.
CAIRN_API std::vector<Eigen::Vector2d> touched_points(std::span<const Eigen::Vector2d> points,
                                                      const Pose2& motion, const RobotModel& robot);

/// A motion with which the body passes beside what it would touch on another one: as long, or half
/// as long, and up to 30° to a side, or as far as a `differential` robot can turn on it. None:
/// there is no such motion, or the robot can't turn in place.
CAIRN_API std::optional<Pose2> motion_beside(std::span<const Eigen::Vector2d> points,
                                             const Pose2& motion, const RobotModel& robot);

}  // namespace cairn
