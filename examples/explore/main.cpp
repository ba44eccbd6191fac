// SPDX-License-Identifier: BSD-3-Clause
// A robot that explores: run_exploration over a World of your own.
//
// This one drives in an empty hall of 8 m × 6 m that only it knows. A real robot sends `motion` to
// its wheels, waits until it is there, and returns what its odometry and its lidar have measured.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "cairn/exploration/exploration.hpp"
#include "cairn/plugin/registry.hpp"

namespace {

class HallRobot final : public cairn::World {
 public:
  cairn::RobotModel robot() const override { return {.radius = 0.25}; }

  cairn::LaserScan begin(const cairn::WorldStart&) override { return scan(); }

  cairn::WorldStep move(const cairn::Pose2& motion) override {
    at_ = at_ * motion;
    return {.odometry = motion, .covariance = robot().odometry.covariance(motion), .scan = scan()};
  }

  // A robot that is not simulated does not know where it is; its map begins at the origin.
  std::optional<cairn::Pose2> truth() const override { return std::nullopt; }

 private:
  cairn::LaserScan scan() const {
    const cairn::LidarModel lidar = robot().lidar;
    cairn::LaserScan scan{lidar.first_angle(), lidar.step(), lidar.range, {}};
    for (int beam = 0; beam < lidar.beams; ++beam) {
      const double angle = at_.theta() + scan.angle(static_cast<std::size_t>(beam));
      const double along_x = to_wall(at_.x(), std::cos(angle), 8.0);
      const double along_y = to_wall(at_.y(), std::sin(angle), 6.0);
      scan.ranges.push_back(static_cast<float>(std::min({along_x, along_y, lidar.range})));
    }
    return scan;
  }

  static double to_wall(double from, double direction, double end) {
    if (direction == 0.0) return std::numeric_limits<double>::infinity();
    return ((direction > 0.0 ? end : 0.0) - from) / direction;
  }

  cairn::Pose2 at_{2.0, 1.5, 0.3};
};

}  // namespace

int main() {
  cairn::Registry registry;
  HallRobot robot;
  const auto policy = registry.make<cairn::PosePolicy>("compact_pose");
  const auto matcher = registry.make<cairn::Registration>("icp");
  const auto mapper = registry.make<cairn::Mapper>("log_odds");
  const auto explorer = registry.make<cairn::Explorer>("frontier");
  cairn::Exploration parts{.world = robot,
                           .policy = *policy,
                           .registration = *matcher,
                           .mapper = *mapper,
                           .explorer = *explorer,
                           .registry = registry,
                           .start = {},
                           .limits = {.distance = 100.0}};
  parts.decided = [](const cairn::Decision& decision, const cairn::Situation& now) {
    std::printf("%d: %s\n", now.decision, decision.why.c_str());
  };
  const cairn::ExplorationResult run = cairn::run_exploration(parts);
  std::printf("%s: %.0f m² of 48 m² known\n", run.why.c_str(), run.map.coverage());
}
