// SPDX-License-Identifier: BSD-3-Clause
// A robot circles a room again and again. Compact pose SLAM keeps the poses of the first lap, and
// then the map has stopped growing.
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include <cairn/plugin/registry.hpp>
#include <cairn/policy/pose_policy.hpp>

namespace {

constexpr int kPosesPerLap = 40, kLaps = 20;
constexpr double kRadius = 5.0;       // [m]
constexpr double kSigma = 0.02;       // of every measurement [m, rad]
constexpr double kSensorRange = 1.0;  // [m]

/// Where the robot truly is, x [m] y [m] heading [rad].
std::array<double, 3> true_pose(cairn::Id id) {
  const double angle = 2.0 * std::numbers::pi * double(id) / kPosesPerLap;
  return {kRadius * std::sin(angle), kRadius * (1.0 - std::cos(angle)), angle};
}

/// What the robot's sensors say of the motion from one pose to another.
class Sensors {
 public:
  explicit Sensors(std::shared_ptr<const cairn::FactorType> relative_pose)
      : relative_pose_(std::move(relative_pose)) {}

  cairn::Factor measure(cairn::Id from, cairn::Id to) {
    const auto a = true_pose(from), b = true_pose(to);
    const double c = std::cos(a[2]), s = std::sin(a[2]), x = b[0] - a[0], y = b[1] - a[1];
    const double information = 1.0 / (kSigma * kSigma);
    return {relative_pose_,
            {from, to},
            {c * x + s * y + noise(), c * y - s * x + noise(), b[2] - a[2] + noise()},
            {information, 0.0, 0.0, information, 0.0, information}};
  }

 private:
  double noise() { return kSigma * normal_(engine_); }

  std::shared_ptr<const cairn::FactorType> relative_pose_;
  std::mt19937_64 engine_{1};
  std::normal_distribution<double> normal_;
};

double distance(cairn::Id a, cairn::Id b) {
  const auto p = true_pose(a), q = true_pose(b);
  return std::hypot(p[0] - q[0], p[1] - q[1]);
}

void run() {
  cairn::Registry registry;
  const auto pose = registry.variable_type("VERTEX_SE2");
  Sensors sensors(registry.factor_type("EDGE_SE2"));

  auto policy = registry.make<cairn::PosePolicy>("compact_pose:range=1,angle=0.5");
  for (cairn::Id id = 0; id < kLaps * kPosesPerLap; ++id) {
    std::vector<cairn::Factor> odometry;
    if (id > 0) odometry.push_back(sensors.measure(id - 1, id));
    policy->add_pose({pose, id, {}, false}, odometry);

    // The policy asks for the pairs that are worth matching, the most informative first.
    while (const auto match = policy->next_match()) {
      std::vector<cairn::Factor> link;  // stays empty if the two do not match
      if (distance(match->earlier, match->later) < kSensorRange)
        link.push_back(sensors.measure(match->earlier, match->later));
      policy->offer(match->earlier, link);
    }
    policy->end_pose();

    if ((id + 1) % (5 * kPosesPerLap) == 0) {
      std::printf("after %2d laps: %3d of %3d poses kept\n", int(id + 1) / kPosesPerLap,
                  policy->estimator().variable_count(), int(id + 1));
    }
  }
  policy->finish();

  // The poses that were left out can be put back between those that were kept.
  const cairn::Graph way = cairn::recovered_way(*policy, cairn::Recovery::likely);
  std::printf("the whole way: %d poses\n", way.variable_count());
}

}  // namespace

int main() {
  try {
    run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "compact: %s\n", error.what());
    return 1;
  }
  return 0;
}
