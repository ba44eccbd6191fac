// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {

/// A robot that drives round and round, in the plane or in space (the parameter: 2 or 3), among
/// eight landmarks, and knows where it truly is.
class LandmarkCourse : public testing::TestWithParam<int> {
 protected:
  static constexpr int kLap = 24;
  static constexpr Id kFirstLandmark = 1000000;
  static constexpr double kSigma = 0.1;  ///< of what is measured of a landmark [m]

  LandmarkCourse() : world_(test::types_of(GetParam(), registry_)), draw_(5) {
    const bool planar = GetParam() == 2;
    point_ = registry_.variable_type(planar ? "VERTEX_XY" : "VERTEX_TRACKXYZ");
    seen_ = registry_.factor_type(planar ? "EDGE_SE2_XY" : "EDGE_SE3_TRACKXYZ");
    for (int k = 0; k < 8; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / 8.0;
      // The course is a circle of radius kLap / 2π about (0, that).
      landmarks_.emplace_back(6.0 * std::cos(angle),
                              kLap / (2.0 * std::numbers::pi) + 6.0 * std::sin(angle),
                              planar ? 0.0 : 0.5 * std::sin(2.0 * angle));
    }
  }

  /// A policy of these options and its first pose.
  void begin_course(const std::string& options) {
    policy_ = registry_.make<PosePolicy>("compact_pose:reuse=true," + options);
    truth_ = {world_.identity()};
    policy_->add_pose(world_.variable(0, truth_.front(), true), {});
    all_ = {};
    all_.set_fixed(all_.add_variable(world_.types().pose, 0, truth_.front()));
  }
  Id newest() const { return static_cast<Id>(truth_.size()) - 1; }
  Eigen::MatrixXd Sigma(double translation, double rotation) const {
    Eigen::VectorXd sigmas = Eigen::VectorXd::Constant(world_.tangent(), rotation);
    sigmas.head(GetParam()).setConstant(translation);
    return sigmas.cwiseAbs2().asDiagonal();
  }
  /// Moves on by one metre. Returns the odometry from the pose before.
  Factor moved_on() {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(world_.tangent());
    step[0] = 1.0;
    step[step.size() - 1] = 2.0 * std::numbers::pi / kLap;
    truth_.push_back(world_.moved(truth_.back(), step));
    const Eigen::MatrixXd S = Sigma(0.05, 0.02);
    const test::PoseWorld::Pose motion = world_.moved(world_.identity(), step);
    return world_.edge(newest() - 1, newest(), world_.moved(motion, draw_.error(S)), S);
  }
  /// The same as a new pose of the policy and of `all_`; ends the one before.
  PoseReport advance() {
    const PoseReport report = policy_->end_pose();
    const Factor odometry = moved_on();
    all_.add_variable(world_.types().pose, newest(), truth_.back());
    put(odometry);
    policy_->add_pose(world_.variable(newest()), {&odometry, 1});
    return report;
  }
  void put(const Factor& factor) {
    std::vector<int> on;
    for (const Id id : factor.variables) on.push_back(*all_.find(id));
    all_.add_factor(factor.type, on, factor.measurement, factor.information);
  }
  /// What the newest pose measures of a landmark.
  LandmarkObservation see(int landmark, double sigma = kSigma) {
    const auto [R, t] = world_.split(truth_.back());
    const Eigen::Vector3d at = R.transpose() * (landmarks_[static_cast<std::size_t>(landmark)] - t);
    const int d = GetParam();
    std::vector<double> z;
    for (int k = 0; k < d; ++k) z.push_back(at[k] + sigma * draw_.normal());
    const Id id = kFirstLandmark + landmark;
    return {{.type = point_, .id = id, .state = {}},
            {{seen_,
              {newest(), id},
              z,
              pack(Eigen::MatrixXd(Eigen::MatrixXd::Identity(d, d) / (sigma * sigma)))}}};
  }
  /// The landmarks within 4 m of the newest pose.
  std::vector<int> visible() const {
    const Eigen::Vector3d t = world_.split(truth_.back()).second;
    std::vector<int> near;
    for (std::size_t k = 0; k < landmarks_.size(); ++k) {
      if ((landmarks_[k] - t).norm() < 4.0) near.push_back(static_cast<int>(k));
    }
    return near;
  }

  Registry registry_;
  test::PoseWorld world_;
  test::Draw draw_;
  std::shared_ptr<const VariableType> point_;
  std::shared_ptr<const FactorType> seen_;
  std::vector<Eigen::Vector3d> landmarks_;
  std::unique_ptr<PosePolicy> policy_;
  std::vector<test::PoseWorld::Pose> truth_;
  Graph all_;  ///< everything that `put` and `advance` measure, for a batch solution
};

}  // namespace cairn::compact
