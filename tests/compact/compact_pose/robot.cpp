// SPDX-License-Identifier: BSD-3-Clause
#include "compact/compact_pose/robot.hpp"

namespace cairn::compact {
namespace {

Eigen::MatrixXd Sigma(double sigma) { return sigma * sigma * Eigen::MatrixXd::Identity(3, 3); }

}  // namespace

std::string message_of(const std::function<void()>& call, ErrorCode code) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

Robot::Robot(Registry& registry, const std::string& policy, unsigned seed)
    : world_(test::planar_types(registry)),
      policy_(registry.make<PosePolicy>("compact_pose:reuse=false" +
                                        (policy.empty() ? "" : "," + policy))),
      draw_(seed) {
  policy_->add_pose(world_.variable(0, world_.identity()), {});
  truth_.push_back(world_.identity());
}

PoseReport Robot::advance() {
  const PoseReport report = policy_->end_pose();
  begin();
  return report;
}

void Robot::begin() {
  const Eigen::MatrixXd covariance =
      Eigen::Vector3d(0.05 * 0.05, 0.05 * 0.05, 0.02 * 0.02).asDiagonal();
  const Factor moved = measured(newest(), newest() + 1, step_, covariance);
  policy_->add_pose(world_.variable(newest() + 1), {&moved, 1});
  truth_.push_back(world_.compose(truth_.back(), step_));
}

Factor Robot::right(Id other, double sigma) {
  return measured(other, newest(), world_.between(truth_[other], truth_.back()), Sigma(sigma));
}

Factor Robot::wrong(Id other, const Pose& motion, double sigma) const {
  return world_.edge(other, newest(), motion, Sigma(sigma));
}

LinkReport Robot::offer(const Factor& factor) {
  return policy_->offer(factor.variables[0] == newest() ? factor.variables[1] : factor.variables[0],
                        {&factor, 1});
}

double Robot::newest_error() const {
  return world_.log(world_.between(policy_->newest_state(), truth_.back())).norm();
}

Factor Robot::measured(Id from, Id to, const Pose& motion, const Eigen::MatrixXd& covariance) {
  return world_.edge(from, to, world_.moved(motion, draw_.error(covariance)), covariance);
}

}  // namespace cairn::compact
