// SPDX-License-Identifier: BSD-3-Clause
// What is left uncertain of a landmark beside a pose, and whether a measurement is linear over
// that.
#include "linearity.hpp"

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/plugin/registry.hpp"
#include "support/dense_algebra.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

class BesidePose : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, BesidePose, testing::Values(2, 3));

// The oracle moves both, and then all of them back so that the pose is where it was.
TEST_P(BesidePose, IsTheLandmarkWhileThePoseIsHeld) {
  Registry registry;
  const test::PoseWorld world(test::types_of(GetParam(), registry));
  const auto point = registry.variable_type(GetParam() == 2 ? "VERTEX_XY" : "VERTEX_TRACKXYZ");
  const RigidGroup group(world.types().pose);
  test::Draw draw(3);
  for (int trial = 0; trial < 10; ++trial) {
    const VectorXd there = VectorXd::NullaryExpr(world.tangent(), [&] { return draw.normal(); });
    const test::PoseWorld::Pose x = world.moved(world.identity(), there);
    std::vector<double> landmark;
    for (int k = 0; k < GetParam(); ++k) landmark.push_back(5.0 * draw.normal());
    const auto d = GetParam();
    const Eigen::Index n = world.tangent();
    const auto seen = [&](const VectorXd& step) {
      const test::PoseWorld::Pose moved = world.moved(x, step.tail(n));
      const auto [R, t] = world.split(moved);
      const auto [R_x, t_x] = world.split(x);
      Vector3d at = Vector3d::Zero();
      for (int k = 0; k < d; ++k) at[k] = landmark[static_cast<std::size_t>(k)] + step[k];
      return VectorXd((R_x * (R.transpose() * (at - t)) + t_x).head(d));
    };
    MatrixXd C(d, d + n);
    for (Eigen::Index k = 0; k < d + n; ++k) {
      const VectorXd step = 1e-6 * VectorXd::Unit(d + n, k);
      C.col(k) = (seen(step) - seen(-step)) / 2e-6;
    }
    const MatrixXd Sigma = draw.covariance(d + n, 1.0);
    State state{};
    std::copy(x.begin(), x.end(), state.begin());
    const MatrixXd S = beside_pose(group, group.place(state), *point, landmark, Sigma);
    EXPECT_LT((S - C * Sigma * C.transpose()).norm(), 1e-6 * S.norm()) << trial;
  }
}

/// A pose at the origin of the plane that sees a landmark on its x axis.
class Nonlinearity : public testing::Test {
 protected:
  /// Of the bearing (or the range) of a landmark at this distance, uncertain by so much along and
  /// across.
  double of(double distance, double along, double across, bool bearing = true,
            double sigma = 0.01) {
    const double w = 1.0 / (sigma * sigma);
    const Factor factor{registry_.factor_type("EDGE_BEARING_RANGE_SE2_XY"),
                        {1, 100},
                        {0.0, distance},
                        {bearing ? w : 0.0, 0.0, bearing ? 0.0 : w}};
    const VariableType* types[] = {pose_.get(), point_.get()};
    const std::vector<Measured> factors{Measured(factor, types, "a view")};
    const std::vector<double> landmark{distance, 0.0};
    const State x{0.0, 0.0, 0.0};
    const ObservationRows rows = linearized(factors, 1, x.data(), landmark.data());
    return nonlinearity({*point_, landmark, factors, 1, x}, rows,
                        Vector2d(along * along, across * across).asDiagonal());
  }

  Registry registry_;
  std::shared_ptr<const VariableType> pose_ = registry_.variable_type("VERTEX_SE2"),
                                      point_ = registry_.variable_type("VERTEX_XY");
};

TEST_F(Nonlinearity, IsWhatTheWorstSigmaPointIsOffBy) {
  // The corners (4 − 1, ±1): atan(1/3), where the linear model has 1/4, in units of √(σ² + 1/16).
  EXPECT_NEAR(of(4.0, 1.0, 1.0), (std::atan(1.0 / 3.0) - 0.25) / std::hypot(0.01, 0.25), 1e-9);
  // Nothing is off where nothing is uncertain, nor with one alone, at first order.
  EXPECT_NEAR(of(4.0, 0.0, 0.0), 0.0, 1e-12);
  EXPECT_NEAR(of(4.0, 1.0, 0.0), 0.0, 1e-12);
  EXPECT_NEAR(of(4.0, 1.0, 1.0, false), (std::hypot(3.0, 1.0) - 3.0) / std::hypot(0.01, 1.0), 1e-9);
}

TEST_F(Nonlinearity, ExceedsTheLimitWhereABearingIsOfALandmarkThatIsNearerThanItIsKnown) {
  EXPECT_GT(of(2.3, 1.0, 1.0), kMostNonlinear);
  EXPECT_LT(of(2.5, 1.0, 1.0), kMostNonlinear);
  EXPECT_GT(of(2.9, 1.0, 0.1), kMostNonlinear);
  EXPECT_LT(of(3.1, 1.0, 0.1), kMostNonlinear);
  // In another unit of length nothing is different.
  EXPECT_NEAR(of(2.5e6, 1e6, 1e6), of(2.5, 1.0, 1.0), 1e-9);
  EXPECT_NEAR(of(2.5e-6, 1e-6, 1e-6), of(2.5, 1.0, 1.0), 1e-6);
  // A bearing of large variance, beside what is known, is linear enough at that distance.
  EXPECT_LT(of(2.3, 1.0, 1.0, true, 1.0), kMostNonlinear);
  // What is not known across is known all the same once bearings are.
  EXPECT_LT(of(10.0, 5.0, 0.03), kMostNonlinear);
}

TEST_F(Nonlinearity, IsWithoutLimitWhereNothingCanBeSaid) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(of(4.0, kInfinity, 1.0), kInfinity);
  EXPECT_EQ(of(4.0, std::numeric_limits<double>::quiet_NaN(), 1.0), kInfinity);
}

}  // namespace
}  // namespace cairn::compact
