// SPDX-License-Identifier: BSD-3-Clause
// A robot circles a room again and again. Compact pose SLAM keeps the poses of the first lap, and
// then the map has stopped growing.
#include <iostream>
#include <numbers>
#include <random>
#include <vector>

#include <cairn/cairn.hpp>
#include <cairn/policy/pose_policy.hpp>

using namespace cairn;

constexpr int kPosesPerLap = 40, kLaps = 20;

/// Where the robot truly is: on a circle of 5 m radius.
Pose2 truth(Id id) {
  const double angle = 2.0 * std::numbers::pi * double(id) / kPosesPerLap;
  return Pose2::exp({5.0 * angle, 0.0, angle});
}

/// What the robot's sensors say of the motion from one pose to another.
Factor measure(Id from, Id to) {
  static std::mt19937_64 engine(1);
  std::normal_distribution<double> noise(0.0, 0.02);  // [m, rad]
  const Pose2 motion = truth(from).between(truth(to));
  const Pose2 measured = motion.retract({noise(engine), noise(engine), noise(engine)});
  return make_factor(Between(from, to, measured), Information::isotropic(3, 0.02));
}

int main() {
  const auto policy = make<PosePolicy>("compact_pose:range=1,angle=0.5,reuse=true");
  for (Id id = 0; id < kLaps * kPosesPerLap; ++id) {
    std::vector<Factor> odometry;
    if (id > 0) odometry.push_back(measure(id - 1, id));
    policy->add_pose(make_variable<Pose2>(id), odometry);
    // The policy asks for the pairs that are worth matching; the sensor sees as far as one metre.
    while (const auto match = policy->next_match()) {
      std::vector<Factor> link;  // stays empty if the two do not match
      const Pose2 apart = truth(match->earlier).between(truth(match->later));
      if (apart.translation().norm() < 1.0) link.push_back(measure(match->earlier, match->later));
      policy->offer(match->earlier, link);
    }
    policy->end_pose();
  }
  policy->finish();
  std::cout << "poses kept: " << policy->estimator().variable_count() << "\nthe trajectory: "
            << recovered_trajectory(*policy, Recovery::likely).variable_count() << " poses\n";
}
