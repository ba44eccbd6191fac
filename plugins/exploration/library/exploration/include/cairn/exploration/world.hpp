// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "cairn/exploration/laser_scan.hpp"
#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// How odometry errs: the standard deviation of each component of a motion u (forward [m], left
/// [m], turn [rad]) is sqrt(absolute² + (relative |u|)²), per step.
struct OdometryModel {
  Eigen::Vector3d absolute = Eigen::Vector3d(0.01, 0.01, 0.005);
  double relative = 0.05;

  Eigen::Vector3d sigma(const Pose2& motion) const {
    const Eigen::Vector3d u(motion.x(), motion.y(), motion.theta());
    return (absolute.array().square() + (relative * u.array()).square()).sqrt();
  }
  /// Of ξ in u · exp(ξ): diagonal.
  Eigen::Matrix3d covariance(const Pose2& motion) const {
    return sigma(motion).array().square().matrix().asDiagonal();
  }
};

/// How a robot moves.
enum class MotionModel {
  differential,  ///< turns in place, and drives straight ahead
  holonomic,     ///< drives in any direction at once, and turns on the way
  /// Drives ahead, straight or along arcs, and can't turn in place; where there is no other way it
  /// backs.
  dubins
};
constexpr auto enum_names(MotionModel) {
  return std::to_array<EnumName<MotionModel>>({{MotionModel::differential, "differential"},
                                               {MotionModel::holonomic, "holonomic"},
                                               {MotionModel::dubins, "dubins"}});
}

/// What a robot is and senses, as planners and explorers need it.
struct RobotModel {
  double radius = 0.2;  ///< of its round body [m]
  double step = 0.5;    ///< farthest that it drives between two scans [m]
  double turn = 0.3;    ///< most that it turns between two scans [rad]
  MotionModel motion = MotionModel::differential;
  double turning_radius = 0.5;  ///< least one of `dubins` [m]
  LidarModel lidar;
  OdometryModel odometry;
};

/// Where a run begins.
struct WorldStart {
  const OccupancyGrid* floor = nullptr;  ///< to drive on; a robot that is not simulated has its own
  /// In the frame of the floor; none: the world chooses, the heading by the seed.
  std::optional<Pose2> pose = {};
  std::uint64_t seed = 1;  ///< of all noise
};

/// What follows a motion.
struct WorldStep {
  Pose2 odometry;  ///< the motion as odometry has it, in the frame of the pose before
  /// Of ξ in odometry · exp(ξ).
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  LaserScan scan;
  bool collided = false;  ///< an obstacle stopped it before it was there
};

/// A robot with a lidar, simulated or not: it takes motions, and returns odometry and scans.
///
///     LaserScan first = world.begin({.floor = &floor, .seed = 7});
///     WorldStep step = world.move(Pose2(0.4, 0.0, 0.1));
class CAIRN_API World : public Component {
 public:
  static constexpr std::string_view kKind = "world";
  ~World() override;

  virtual RobotModel robot() const = 0;
  /// Puts the robot at its start and takes the first scan. Throws `Error` (usage) without what it
  /// needs, (input) for a start where its body does not fit.
  virtual LaserScan begin(const WorldStart& start) = 0;
  /// Moves straight to `motion`, in the frame of where the robot truly is, turning on the way; a
  /// robot of `MotionModel::dubins` along the arc that leads there, ahead or back. It stops where
  /// its body would touch an obstacle. Throws `Error` (usage) for a motion that such a robot can't
  /// make.
  virtual WorldStep move(const Pose2& motion) = 0;
  /// Where the robot truly is, in the frame of the floor; none: that is not known.
  virtual std::optional<Pose2> truth() const = 0;
};

}  // namespace cairn
