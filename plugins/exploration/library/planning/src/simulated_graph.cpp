// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/simulated_graph.hpp"

#include <algorithm>
#include <utility>

#include "cairn/runtime/error.hpp"
#include "cairn/typed/build.hpp"

namespace cairn {

SimulatedGraph::SimulatedGraph(const Situation& situation, Registry& registry)
    : situation_(situation),
      registry_(registry),
      estimator_(situation.estimator.clone()),
      poses_(situation.poses.begin(), situation.poses.end()) {
  if (poses_.empty()) throw Error(ErrorCode::usage, "a simulated drive needs a pose graph");
  next_ = std::ranges::max(estimator_->variables()) + 1;
  at_ = Pose2::from_state(situation.estimator.state(poses_.back()));
  constexpr double kRounding = 1e-9;
  if (at_.between(situation.pose).state().cwiseAbs().maxCoeff() > kRounding) add(situation.pose);
}

Id SimulatedGraph::add(const Pose2& pose) {
  const Pose2 motion = at_.between(pose);
  const Eigen::Matrix3d noise = situation_.robot.odometry.covariance(motion);
  pending_.variables.push_back(make_variable(next_, pose, registry_));
  pending_.factors.push_back(make_factor(Between(poses_.back(), next_, motion),
                                         Information::covariance(noise), nullptr, registry_));
  poses_.push_back(next_);
  at_ = pose;
  return next_++;
}

void SimulatedGraph::close(Id older) {
  const Pose2 other = Pose2::from_state(situation_.estimator.state(older));
  pending_.factors.push_back(make_factor(Between(older, poses_.back(), other.between(at_)),
                                         Information::covariance(situation_.match.covariance()),
                                         nullptr, registry_));
}

void SimulatedGraph::update() { estimator_->update(std::exchange(pending_, {})); }

}  // namespace cairn
