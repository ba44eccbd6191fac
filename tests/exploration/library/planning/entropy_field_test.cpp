// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/entropy_field.hpp"

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "cairn/plugin/registry.hpp"
#include "cairn/typed/build.hpp"
#include "planning_maps.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using std::numbers::pi;

/// A robot that drives a loop in the middle of a floor, with a loop closure.
struct Drive {
  Drive() : map(test::random_map(draw, 60, 50, 0.1)) {
    robot.radius = 0.1;
    estimator = default_registry().make<Estimator>("incremental_cholesky");
    estimator->keep_marginals(KeptMarginals::diagonal);
    GraphUpdate update;
    Pose2 at(2.0, 1.5, 0.3);
    constexpr int kPoses = 20;
    const Pose2 motion(0.4, 0.02, 0.25);
    for (Id id = 0; id < kPoses; ++id) {
      if (id > 0) {
        at = at * motion;
        update.factors.push_back(
            make_factor(Between(id - 1, id, motion), Information::sigmas(0.05, 0.03, 0.02)));
      }
      Variable variable = make_variable(id, at);
      variable.fixed = id == 0;
      update.variables.push_back(variable);
      poses.push_back(id);
    }
    update.factors.push_back(
        make_factor(Between(2, 12, Pose2(0.3, -0.2, 2.5)), Information::sigmas(0.05, 0.05, 0.01)));
    estimator->update(update, {.full = true});
  }

  Situation situation() {
    const Pose2 now(Vector3d(estimator->state(poses.back()).data()));
    return {.estimator = *estimator, .poses = poses, .pose = now, .map = map, .robot = robot};
  }

  test::Draw draw{17};
  FloorMap map;
  RobotModel robot;
  std::unique_ptr<Estimator> estimator;
  std::vector<Id> poses;
};

bool without_estimator() { return !default_registry().has("estimator", "incremental_cholesky"); }

Pose2 state(Estimator& estimator, Id id) {
  return Pose2(Eigen::Map<const Vector3d>(estimator.state(id).data()));
}

/// x, y and θ of the world, moved by δ.
Pose2 moved(const Pose2& pose, const Vector3d& delta) {
  return {pose.x() + delta.x(), pose.y() + delta.y(), pose.theta() + delta.z()};
}

/// The information matrix of all poses but the fixed one, in world coordinates.
MatrixXd world_information(Estimator& estimator, std::span<const Id> poses) {
  const auto size = static_cast<Eigen::Index>(3 * poses.size());
  const std::vector<double> joint = joint_covariance(estimator, poses, 3);
  const MatrixXd local = Eigen::Map<const MatrixXd>(joint.data(), size, size);
  MatrixXd turn = MatrixXd::Identity(size, size);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(3 * k);
    const double angle = state(estimator, poses[k]).theta();
    turn.block<2, 2>(at, at) = Eigen::Rotation2Dd(angle).toRotationMatrix();
  }
  return (turn * local * turn.transpose()).inverse();
}

double log_determinant(const MatrixXd& A) {
  return 2.0 * Eigen::LLT<MatrixXd>(A).matrixLLT().diagonal().array().log().sum();
}

/// (5.8) by its meaning: the whole information matrix with the loop closure and without, its
/// Jacobian by differences of the relative pose.
TEST(LoopClosureValues, AreTheChangeOfTheDenseDeterminant) {
  if (without_estimator()) GTEST_SKIP() << "without the estimator";
  Drive drive;
  Estimator& estimator = *drive.estimator;
  const std::span free = std::span(drive.poses).subspan(1);
  const MatrixXd H = world_information(estimator, free);
  const auto newest = H.rows() - 3;
  Situation situation = drive.situation();
  situation.match = {.range = 0.5, .angle = 0.2, .sigma = Vector3d(0.04, 0.07, 0.003)};
  const auto standard = loop_closure_values(situation, EntropyForm::standard);
  const auto thesis = loop_closure_values(situation, EntropyForm::thesis);
  ASSERT_GE(standard.size(), 15U);
  ASSERT_EQ(standard.size(), thesis.size());
  double least = 0.0;
  for (std::size_t k = 0; k < standard.size(); ++k) {
    const Pose2 earlier = state(estimator, standard[k].id);
    MatrixXd J = MatrixXd::Zero(3, H.cols());
    constexpr double kStep = 1e-6;
    for (int c = 0; c < 3; ++c) {
      const Vector3d step = kStep * Vector3d::Unit(c);
      // The newest pose turned up at the earlier one.
      J.block<3, 1>(0, newest + c) += (earlier.between(moved(earlier, step)).state() -
                                       earlier.between(moved(earlier, -step)).state()) /
                                      (2.0 * kStep);
      if (standard[k].id == 0) continue;
      J.block<3, 1>(0, 3 * (standard[k].id - 1) + c) +=
          (moved(earlier, step).between(earlier).state() -
           moved(earlier, -step).between(earlier).state()) /
          (2.0 * kStep);
    }
    const Matrix3d omega = situation.match.covariance().inverse();
    const double expected = log_determinant(H + J.transpose() * omega * J) - log_determinant(H);
    EXPECT_NEAR(standard[k].change, -0.5 * expected, 1e-6 * expected) << standard[k].id;
    EXPECT_NEAR(thesis[k].change, -expected, 1e-6 * expected);
    least = std::min(least, standard[k].change);
  }
  EXPECT_LT(least, -1.0);
}

TEST(LoopClosureValues, LeaveOutThePosesThatTheNewestIsBeside) {
  if (without_estimator()) GTEST_SKIP() << "without the estimator";
  Drive drive;
  const Situation situation = drive.situation();
  std::size_t beside = 0;
  for (const Id id : drive.poses)
    beside += can_match(state(*drive.estimator, id), situation.pose, situation.match);
  ASSERT_GE(beside, 2U);
  const auto values = loop_closure_values(situation, EntropyForm::standard);
  EXPECT_EQ(values.size(), drive.poses.size() - beside);
  for (const LoopClosureValue& value : values)
    EXPECT_FALSE(can_match(value.pose, situation.pose, situation.match));
}

/// Every configuration against the definition.
TEST(EntropyField, IsTheBestLoopClosureAndTheFrontiersInSight) {
  if (without_estimator()) GTEST_SKIP() << "without the estimator";
  Drive drive;
  const Situation situation = drive.situation();
  const EntropyFieldOptions options{.orientations = 24, .left = 0.1};
  const EntropyField field(situation, options);
  const FrontierView view(field.space(), beam_cells(drive.map), drive.robot.lidar, 360);
  const JointObjective objective({}, 0.1, drive.robot.lidar.range);
  const Matrix3d now = newest_covariance(situation).value();
  double least = 0.0;
  std::size_t in_areas = 0, best = 0;
  for (std::size_t k = 0; k < field.space().size(); ++k) {
    double trajectory = 0.0;
    for (const LoopClosureValue& loop : field.loop_closures()) {
      if (can_match(loop.pose, field.space().pose(k), situation.match))
        trajectory = std::min(trajectory, loop.change);
    }
    in_areas += trajectory < 0.0;
    const InformationChange change = field.change(k);
    ASSERT_NEAR(change.trajectory, trajectory, 1e-5);
    ASSERT_NEAR(change.map, -0.01 * (std::log(2.0) - 0.1) * view.seen(k), 1e-12);
    ASSERT_DOUBLE_EQ(change.alpha, objective.alpha(now));
    ASSERT_NEAR(field.value(k), objective.value(change, 123.0, now), 1e-9);
    if (field.value(k) < least) {
      least = field.value(k);
      best = k;
    }
  }
  EXPECT_GT(in_areas, 100U);
  const std::vector<char> all(field.space().cells().size(), 1), none(all.size(), 0);
  EXPECT_EQ(field.best(all), best);
  EXPECT_FALSE(field.best(none));
  EXPECT_NE(field.best(all), EntropyField(situation, options, {.loop_closures = false}).best(all));
}

/// The prior on the first pose, which is fixed, against a graph that has it.
TEST(NewestCovariance, IsThatOfAGraphWithAPriorOnTheFirstPose) {
  if (without_estimator()) GTEST_SKIP() << "without the estimator";
  GraphUpdate fixed, with_prior;
  const Pose2 first(1.0, -2.0, 0.4), motion(2.0, 0.3, 1.0);
  const Vector3d sigma(0.05, 0.03, 0.01);
  for (GraphUpdate* update : {&fixed, &with_prior}) {
    update->variables = {make_variable(0, first), make_variable(1, first * motion)};
    update->factors = {make_factor(Between(0, 1, motion), Information::sigmas(0.1, 0.05, 0.02))};
  }
  fixed.variables.front().fixed = true;
  with_prior.factors.push_back(
      make_factor(Prior(0, first), Information::sigmas(sigma.x(), sigma.y(), sigma.z())));
  const auto a = default_registry().make<Estimator>("incremental_cholesky");
  const auto b = default_registry().make<Estimator>("incremental_cholesky");
  a->update(fixed);
  b->update(with_prior);
  Matrix3d expected;
  ASSERT_TRUE(b->covariance(1, 1, {expected.data(), 9}));
  const std::vector<Id> poses{0, 1};
  const FloorMap map;
  const RobotModel robot;
  const Situation situation{.estimator = *a,
                            .poses = poses,
                            .pose = first * motion,
                            .map = map,
                            .robot = robot,
                            .first_sigma = sigma};
  EXPECT_TRUE(newest_covariance(situation).value().isApprox(expected, 1e-6));
}

}  // namespace
}  // namespace cairn
