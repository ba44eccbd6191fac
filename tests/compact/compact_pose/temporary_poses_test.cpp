// SPDX-License-Identifier: BSD-3-Clause
// Poses that landmarks locate: which of them stay.
#include "information_loss.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/policy/pose_policy.hpp"
#include "compact/compact_pose/landmark_course.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Draw;
using test::log_determinant_of;
using test::PoseWorld;
using test::symmetric_inverse;

MatrixXd rows_of(Draw& draw, Eigen::Index rows, Eigen::Index columns) {
  return MatrixXd::NullaryExpr(rows, columns, [&] { return draw.normal(); });
}

TEST(Eliminate, LeavesTheSchurComplement) {
  Draw draw(3);
  for (int trial = 0; trial < 20; ++trial) {
    const MatrixXd J = rows_of(draw, 4 + trial % 4, 8);
    const MatrixXd H = J.transpose() * J, R = eliminate(J, 3);
    const MatrixXd schur =
        H.bottomRightCorner(5, 5) - H.bottomLeftCorner(5, 3) *
                                        symmetric_inverse(MatrixXd(H.topLeftCorner(3, 3))) *
                                        H.topRightCorner(3, 5);
    EXPECT_LT((R.transpose() * R - schur).norm(), 1e-9 * H.norm());
  }
}

TEST(InformationAbout, IsTheEntropyThatASetLosesByMeasurements) {
  Draw draw(4);
  for (int trial = 0; trial < 30; ++trial) {
    // C = (0 … 4); of these 3 and 4 are not in the set S = (0, 1, 2, 5), nor is 6.
    const MatrixXd others = symmetric_inverse(draw.covariance(7, 1.0));
    const MatrixXd R = rows_of(draw, 1 + trial % 6, 5);
    MatrixXd with = others;
    with.topLeftCorner(5, 5) += R.transpose() * R;
    const std::array set{0, 1, 2, 5};
    const std::array rest{3, 4, 6};
    const auto part = [](const MatrixXd& A, const auto& of) { return MatrixXd(A(of, of)); };
    const double expected = 0.5 * (log_determinant_of(part(symmetric_inverse(others), set)) -
                                   log_determinant_of(part(symmetric_inverse(with), set)));
    const MatrixXd S = symmetric_inverse(with).topLeftCorner(5, 5);
    MatrixXd S_given = MatrixXd::Zero(5, 5);
    S_given.bottomRightCorner(2, 2) = symmetric_inverse(part(with, rest)).topLeftCorner(2, 2);
    EXPECT_NEAR(information_about(R, S, S_given), expected, 1e-9 * (1.0 + expected));
  }
}

TEST(InformationAbout, IsInfiniteWhereNothingElseDetermines) {
  const MatrixXd R = MatrixXd::Identity(2, 2);
  EXPECT_EQ(information_about(R, MatrixXd::Identity(2, 2), MatrixXd::Zero(2, 2)),
            std::numeric_limits<double>::infinity());
}

TEST(InformationAbout, IsInfiniteWhereRoundingHidesThatNothingElseDetermines) {
  const MatrixXd R = MatrixXd::Identity(2, 2);
  const double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(information_about(R, MatrixXd::Identity(2, 2) * 0.999, MatrixXd::Identity(2, 2)),
            infinite);
  EXPECT_EQ(information_about(R, MatrixXd::Constant(2, 2, std::nan("")), MatrixXd::Zero(2, 2)),
            infinite);
}

class TemporaryPoses : public LandmarkCourse {
 protected:
  void begin(const std::string& options) {
    begin_course("range=3,angle=0.6" + (options.empty() ? "" : "," + options));
  }
  PoseReport advance() {
    const PoseReport report = policy_->end_pose();
    removed_ = policy_->removed();
    const Factor odometry = moved_on();
    policy_->add_pose(world_.variable(newest()), {&odometry, 1});
    return report;
  }
  void drive(int poses) {
    for (int k = 0; k < poses; ++k) {
      for (const int landmark : visible()) policy_->offer_landmark(see(landmark));
      const PoseReport report = advance();
      if (report.kept) kept_.insert(report.id);
      for (const Id id : removed_) kept_.erase(id);
    }
  }
  double error(Id pose, std::span<const double> state) const {
    return world_
        .log(world_.between(truth_[static_cast<std::size_t>(pose)],
                            PoseWorld::Pose(state.begin(), state.end())))
        .head(GetParam())
        .norm();
  }

  std::set<Id> kept_{0};
  std::vector<Id> removed_;
};

INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, TemporaryPoses, testing::Values(2, 3));

TEST_P(TemporaryPoses, TheMapOfAPlaceStopsGrowing) {
  begin("");
  drive(25 * kLap);
  const auto kept = policy_->kept().size();
  const int factors = policy_->factor_count();
  drive(25 * kLap);
  // Each lap tells less than the one before: ½ ln (1 + 1/k) nats of each number after k of them.
  EXPECT_LT(static_cast<double>(policy_->kept().size()), 1.25 * static_cast<double>(kept));
  EXPECT_LT(policy_->factor_count(), 1.25 * factors);
  EXPECT_LT(kept, 8U * kLap);
  policy_->end_pose();
  ASSERT_TRUE(policy_->finish());
  EXPECT_EQ(policy_->landmarks().size(), 8U);
  // Only measurements that were made are in the graph, so that it is no more certain than it may.
  EXPECT_LT(policy_->estimator().chi2(), 1.5 * GetParam() * policy_->estimator().factor_count());
}

TEST_P(TemporaryPoses, WhatHasLeftIsSaid) {
  begin("");
  drive(10 * kLap);
  const std::vector<Id> now = policy_->kept();
  EXPECT_LT(now.size(), 10U * kLap);
  EXPECT_EQ(std::set<Id>(now.begin(), now.end()), kept_);
}

TEST_P(TemporaryPoses, TheWholeTrajectoryIsRecoveredAboutAsWellAsIfAllStayed) {
  const auto root_mean_square = [&](const std::string& options) {
    draw_ = Draw(7);
    begin(options);
    drive(12 * kLap);
    policy_->end_pose();
    EXPECT_TRUE(policy_->finish());
    const Graph whole = recovered_trajectory(*policy_, Recovery::likely);
    EXPECT_EQ(whole.variable_count(), static_cast<int>(truth_.size()));
    double sum = 0.0;
    for (int v = 0; v < whole.variable_count(); ++v)
      sum += std::pow(error(whole.id(v), whole.state(v)), 2);
    return std::sqrt(sum / whole.variable_count());
  };
  EXPECT_LT(root_mean_square(""), 1.3 * root_mean_square("strategy=apfl"));
}

TEST_P(TemporaryPoses, AllStayWhereNoneMayBeLost) {
  begin("landmark_loss=0");
  drive(3 * kLap);
  const std::size_t all = kept_.size();
  begin("landmark_loss=3");
  kept_ = {0};
  drive(3 * kLap);
  EXPECT_LT(kept_.size(), all / 2);
}

TEST_P(TemporaryPoses, WithoutLandmarksThereAreNone) {
  begin("");
  for (int k = 0; k < 4 * kLap; ++k) {
    advance();
    EXPECT_THAT(policy_->removed(), testing::IsEmpty());
  }
}

}  // namespace
}  // namespace cairn::compact
