// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/typed/covariance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include <Eigen/LU>

#include "cairn/typed/run.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

std::string refusal(ErrorCode code, const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  return {};
}

/// A known pose and one a metre ahead of it: Σ of the second is Σ of the first, moved, plus that of
/// the measurement.
const Pose2 kMotion(1.0, 0.0, 0.5);
const Information kFirst = Information::sigmas(0.1, 0.2, 0.3),
                  kStep = Information::sigmas(0.01, 0.02, 0.03);

Eigen::Matrix3d expected_of_second() {
  const Eigen::Matrix3d Ad = kMotion.inverse().adjoint();
  // The error of slam2d is in the frame of the measurement's end: J = I at zero error.
  return Ad * kFirst.matrix().inverse() * Ad.transpose() + kStep.matrix().inverse();
}

Graph two_poses() {
  Graph graph;
  graph.add(10, Pose2());
  graph.add(20, kMotion);
  graph.add(Prior(10, Pose2()), kFirst);
  graph.add(Between(10, 20, kMotion), kStep);
  return graph;
}

TEST(GraphCovariance, IsThatOfTheFactorsByHand) {
  const Graph graph = two_poses();
  EXPECT_LT((covariance(graph, 10) - kFirst.matrix().inverse()).norm(), 1e-12);
  EXPECT_LT((covariance(graph, 20) - expected_of_second()).norm(), 1e-12);
  const Eigen::Matrix3d cross = kFirst.matrix().inverse() * kMotion.inverse().adjoint().transpose();
  EXPECT_LT((cross_covariance(graph, 10, 20) - cross).norm(), 1e-12);
  EXPECT_LT((cross_covariance(graph, 20, 10) - cross.transpose()).norm(), 1e-12);
}

TEST(GraphCovariance, IsGivenForManyAtOnceInTheirOrder) {
  Graph graph = two_poses();
  graph.add(5, Point2(2.0, 2.0));
  graph.add(Prior(5, Point2(2.0, 2.0)), Information::sigmas(0.5, 0.25));
  const std::vector<Id> ids{20, 5, 10};
  const std::vector<Eigen::MatrixXd> all = covariances(graph, ids);
  ASSERT_EQ(all.size(), 3U);
  for (std::size_t k = 0; k < ids.size(); ++k)
    EXPECT_LT((all[k] - covariance(graph, ids[k])).norm(), 1e-15);
  EXPECT_NEAR(all[1](0, 0), 0.25, 1e-15);
  EXPECT_EQ(all[1].rows(), 2);
}

TEST(GraphCovariance, SaysWhyThereIsNone) {
  const Graph graph = two_poses();
  EXPECT_THAT(refusal(ErrorCode::usage, [&] { covariance(graph, 7); }),
              HasSubstr("there is no variable 7"));
  Graph free;
  free.add(0, Point2());
  free.add(1, Pose2(-1.0, 0.0, 0.0));
  free.add(BearingRange(1, 0, 0.0, 1.0), Information::unit(2));
  free.set_fixed(0);  // a range and a bearing do not say where the pose is
  EXPECT_THAT(refusal(ErrorCode::numerical, [&] { covariance(free, 1); }),
              HasSubstr("there are no covariances"));
}

TEST(GraphCovariance, IsRefusedForAVariableThatNothingMeasures) {
  Graph graph;
  graph.add(0, Pose2());
  graph.add(1, Pose2());
  graph.add(7, Pose2());
  graph.add(Between(0, 1, kMotion), kStep);
  EXPECT_THAT(refusal(ErrorCode::numerical, [&] { covariance(graph, 7); }),
              HasSubstr("there is no covariance of VERTEX_SE2 7: it has no factor"));
  covariance(graph, 1);  // of the others there is
  graph.set_fixed(2);
  EXPECT_EQ(covariance(graph, 7).norm(), 0.0);
}

TEST(EstimatorValues, AreThoseOfTheGraph) {
  const auto estimator = make<Estimator>("incremental_cholesky");
  GraphUpdate update;
  update.add(10, Pose2());
  update.add<Pose2>(20);
  update.add(Prior(10, Pose2()), kFirst);
  update.add(Between(10, 20, kMotion), kStep);
  estimator->update(update);
  EXPECT_TRUE(estimate<Pose2>(*estimator, 20).equals(kMotion, 1e-12));
  EXPECT_LT((covariance<Pose2>(*estimator, 20) - expected_of_second()).norm(), 1e-12);
  EXPECT_THAT(refusal(ErrorCode::usage, [&] { estimate<Pose3>(*estimator, 20); }),
              HasSubstr("VERTEX_SE2 20 is not a VERTEX_SE3:QUAT, which a Pose3 is read from"));
  EXPECT_THAT(refusal(ErrorCode::usage, [&] { covariance<Point2>(*estimator, 20); }),
              HasSubstr("which a Point2 is read from"));
}

}  // namespace
}  // namespace cairn
