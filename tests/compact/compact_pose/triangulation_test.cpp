// SPDX-License-Identifier: BSD-3-Clause
// Where several poses see a landmark that no one of them determines, and whether they do.
#include "triangulation.hpp"

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/lie/se2.hpp"
#include "cairn/plugin/registry.hpp"
#include "support/dense_algebra.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Draw;
using test::log_determinant_of;
using test::symmetric_inverse;

/// Poses in the plane that see a landmark, each by a bearing or by a distance alone.
class Triangulate : public testing::Test {
 protected:
  static constexpr double kSigma = 0.01;  ///< of a bearing [rad]
  static constexpr double kTrust = 0.01;

  /// With the information of one of the two numbers alone.
  View view(Id pose, const Vector3d& x, const Vector2d& landmark, bool bearing,
            double sigma = kSigma, double error = 0.0) {
    const Vector2d d = landmark - x.head<2>();
    const double w = 1.0 / (sigma * sigma);
    const std::vector<double> z{std::atan2(d.y(), d.x()) - x[2] + (bearing ? error : 0.3),
                                bearing ? 1.0 : d.norm() + error};
    const Factor factor{registry_.factor_type("EDGE_BEARING_RANGE_SE2_XY"),
                        {pose, 100},
                        z,
                        {bearing ? w : 0.0, 0.0, bearing ? 0.0 : w}};
    const VariableType* types[] = {pose_.get(), point_.get()};
    return {pose, {Measured(factor, types, "a view")}};
  }
  std::optional<Triangulation> found(const std::vector<Vector3d>& poses,
                                     const std::vector<View>& views, const MatrixXd& covariance) {
    std::vector<PlacedView> placed;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const Vector3d& x = poses[k];
      placed.push_back({.factors = views[k].factors,
                        .pose = views[k].pose,
                        .x = {x[0], x[1], x[2]},
                        .at = {x[0], x[1], 0.0},
                        .to_last = Se2::adjoint(Se2::between<double>(x, poses.back()))});
    }
    return triangulate(*point_, placed, covariance, kTrust);
  }
  /// Poses that are known, and see the landmark without error.
  std::optional<Triangulation> found(const std::vector<Vector3d>& poses, const Vector2d& landmark,
                                     bool bearing, double sigma = kSigma) {
    std::vector<View> views;
    for (std::size_t k = 0; k < poses.size(); ++k)
      views.push_back(view(static_cast<Id>(k), poses[k], landmark, bearing, sigma));
    const auto n = static_cast<Eigen::Index>(3 * poses.size());
    return found(poses, views, MatrixXd::Zero(n, n));
  }

  Registry registry_;
  std::shared_ptr<const VariableType> pose_ = registry_.variable_type("VERTEX_SE2"),
                                      point_ = registry_.variable_type("VERTEX_XY");
};

TEST_F(Triangulate, FindsALandmarkAnywhere) {
  for (int k = 0; k < 40; ++k) {
    const double angle = 0.157 * k, distance = 1.0 + 0.4 * k;
    const Vector2d landmark(distance * std::cos(angle), distance * std::sin(angle));
    const std::vector<Vector3d> poses{{-3.0, 0.4, 0.3}, {0.1, -2.5, 2.0}, {0.0, 3.0, -1.0}};
    for (const bool bearing : {true, false}) {
      const auto point = found(poses, landmark, bearing, 1e-3);
      ASSERT_TRUE(point) << k << bearing;
      EXPECT_LT((Vector2d(point->state[0], point->state[1]) - landmark).norm(), 1e-6) << k;
    }
  }
}

TEST_F(Triangulate, WaitsForParallax) {
  // Two poses side by side, b apart, at the distance d: parallax b/d, of two bearings, so that d
  // has the standard deviation √2 σ d² / b.
  const auto determined = [&](double part) {
    constexpr double kFar = 20.0;
    const double b = std::sqrt(2.0) * kSigma * kFar / part;
    return found({{0.0, 0.0, 0.0}, {0.0, b, 0.0}}, Vector2d(kFar, 0.5 * b), true).has_value();
  };
  EXPECT_TRUE(determined(0.1));
  EXPECT_TRUE(determined(0.2));
  EXPECT_FALSE(determined(0.4));
  EXPECT_FALSE(determined(1.0));
  EXPECT_FALSE(determined(10.0));
  // In another unit of length nothing is different.
  EXPECT_TRUE(found({{0.0, 0.0, 0.0}, {0.0, 2e-5, 0.0}}, Vector2d(1e-4, 0.0), true));
  EXPECT_TRUE(found({{0.0, 0.0, 0.0}, {0.0, 2e5, 0.0}}, Vector2d(1e6, 0.0), true));
}

TEST_F(Triangulate, WaitsWhereTheRobotTurnsOnTheSpotOrGoesStraightAhead) {
  EXPECT_FALSE(found({{0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}}, Vector2d(3.0, 1.0), true));
  EXPECT_FALSE(found({{0.0, 0.0, 0.0}, {4.0, 0.0, 1.0}}, Vector2d(9.0, 0.0), true));
  EXPECT_FALSE(found({{0.0, 0.0, 0.0}}, Vector2d(9.0, 0.0), true));
}

TEST_F(Triangulate, WaitsWhereTwoPlacesAreAsLikely) {
  // Two circles meet twice, and three whose centres are on a line as well.
  const Vector2d landmark(4.0, 3.0);
  std::vector<Vector3d> poses{{0.0, 0.0, 0.0}, {2.0, 0.0, 0.0}};
  EXPECT_FALSE(found(poses, landmark, false));
  poses.push_back({5.0, 0.0, 0.0});
  EXPECT_FALSE(found(poses, landmark, false));
  poses.push_back({5.0, 0.004, 0.0});
  EXPECT_FALSE(found(poses, landmark, false));
  poses.push_back({5.0, 1.0, 0.0});
  EXPECT_TRUE(found(poses, landmark, false));
}

TEST_F(Triangulate, CountsWhatIsNotKnownOfThePosesBetweenThem) {
  const std::vector<Vector3d> poses{{0.0, 0.0, 0.0}, {0.0, 2.0, 0.0}};
  const Vector2d landmark(15.0, 1.0);
  std::vector<View> views;
  for (Id k = 0; k < 2; ++k)
    views.push_back(view(k, poses[static_cast<std::size_t>(k)], landmark, true));
  const MatrixXd step = Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();
  const auto covariance = [&](const MatrixXd& between) {
    // Where both are is unknown by metres and radians, as seen from the first.
    MatrixXd A = MatrixXd::Identity(3, 3);
    A.block<2, 1>(0, 2) = Vector2d(-2.0, 0.0);  // a turn of the first moves the second
    const MatrixXd first = Vector3d(25.0, 25.0, 0.1).asDiagonal();
    MatrixXd all(6, 6);
    all << first, first * A.transpose(), A * first, A * first * A.transpose() + between;
    return all;
  };
  EXPECT_TRUE(found(poses, views, covariance(step)));
  const MatrixXd turned = Vector3d(1e-4, 1e-4, 0.1 * 0.1).asDiagonal();
  EXPECT_FALSE(found(poses, views, covariance(turned)));
}

// The first pose is the origin: what is known of the newest is what is known of the way to it.
TEST_F(Triangulate, CountsTheWayFromAPoseThatIsKnown) {
  const std::vector<Vector3d> poses{{0.0, 0.0, 0.0}, {0.0, 2.0, 0.0}};
  const Vector2d landmark(15.0, 1.0);
  std::vector<View> views;
  for (Id k = 0; k < 2; ++k)
    views.push_back(view(k, poses[static_cast<std::size_t>(k)], landmark, true));
  const auto with_heading = [&](double sigma) {
    MatrixXd all = MatrixXd::Zero(6, 6);
    all.diagonal().tail<3>() << 1e-4, 1e-4, sigma * sigma;
    return all;
  };
  EXPECT_TRUE(found(poses, views, with_heading(0.001)));
  EXPECT_FALSE(found(poses, views, with_heading(0.2)));
}

// The oracle has the bearings' derivatives by differences, and everything dense.
TEST_F(Triangulate, IsWhereTheWeightedResidualsVanishAndItsGainIsEntropy) {
  Draw draw(17);
  int compared = 0;
  for (int trial = 0; trial < 30; ++trial) {
    const int count = 3 + trial % 4;
    const Vector2d landmark(draw.uniform(-4.0, 4.0), draw.uniform(-4.0, 4.0));
    std::vector<Vector3d> poses;
    std::vector<View> views;
    std::vector<double> measured;
    for (int k = 0; k < count; ++k) {
      const double angle = 1.1 * k;
      poses.emplace_back(9.0 * std::cos(angle), 9.0 * std::sin(angle), draw.uniform(-3.0, 3.0));
      const double error = 0.02 * draw.normal();
      const Vector2d d = landmark - poses.back().head<2>();
      views.push_back(view(k, poses.back(), landmark, true, kSigma, error));
      measured.push_back(std::atan2(d.y(), d.x()) - poses.back()[2] + error);
    }
    const Eigen::Index n = 3 * count;
    const MatrixXd Sigma = draw.covariance(n, 0.02);
    const auto point = found(poses, views, Sigma);
    ASSERT_TRUE(point) << trial;
    ++compared;
    VectorXd x(n + 2);  // poses and landmark
    for (int k = 0; k < count; ++k) x.segment<3>(3 * k) = poses[static_cast<std::size_t>(k)];
    x.tail<2>() << point->state[0], point->state[1];
    const auto residuals = [&](const VectorXd& at) {
      VectorXd e(count);
      for (int k = 0; k < count; ++k) {
        const Vector2d d = at.tail<2>() - at.segment<2>(3 * k);
        e[k] = std::remainder(
                   std::atan2(d.y(), d.x()) - at[3 * k + 2] - measured[static_cast<std::size_t>(k)],
                   2.0 * std::numbers::pi) /
               kSigma;
      }
      return e;
    };
    MatrixXd J(count, n + 2);
    for (Eigen::Index c = 0; c < n + 2; ++c) {
      // A step of a pose is one in its own frame.
      VectorXd step = VectorXd::Zero(n + 2);
      if (c < n && c % 3 < 2) {
        const double heading = x[c - c % 3 + 2];
        const Vector2d along(std::cos(heading), std::sin(heading));
        step.segment<2>(c - c % 3) = c % 3 == 0 ? along : Vector2d(-along.y(), along.x());
      } else {
        step[c] = 1.0;
      }
      J.col(c) = (residuals(x + 1e-6 * step) - residuals(x - 1e-6 * step)) / 2e-6;
    }
    const VectorXd e = residuals(x);
    // Where the point is: with the others as the last pose sees them.
    MatrixXd B = MatrixXd::Zero(n - 3, n);
    for (Eigen::Index k = 0; k < n - 3; k += 3) {
      const auto seen = [&](const Vector3d& step, const Vector3d& last_step) -> Vector3d {
        return Se2::between<double>(Se2::retract<double>(poses.back(), last_step),
                                    Se2::retract<double>(x.segment<3>(k), step));
      };
      const Vector3d here = seen(Vector3d::Zero(), Vector3d::Zero());
      for (Eigen::Index c = 0; c < 3; ++c) {
        const Vector3d step = 1e-6 * Vector3d::Unit(c), none = Vector3d::Zero();
        B.block<3, 1>(k, k + c) = (Se2::local<double>(here, seen(step, none)) -
                                   Se2::local<double>(here, seen(-step, none))) /
                                  2e-6;
        B.block<3, 1>(k, n - 3 + c) = (Se2::local<double>(here, seen(none, step)) -
                                       Se2::local<double>(here, seen(none, -step))) /
                                      2e-6;
      }
    }
    const MatrixXd relative = B * Sigma * B.transpose();
    const MatrixXd J_o = J.leftCols(n - 3), J_l = J.rightCols(2);
    const MatrixXd V = MatrixXd::Identity(count, count) + J_o * relative * J_o.transpose();
    const MatrixXd Lambda = J_l.transpose() * symmetric_inverse(V) * J_l;
    const VectorXd step = symmetric_inverse(Lambda) * (J_l.transpose() * symmetric_inverse(V) * e);
    EXPECT_LT(step.dot(Lambda * step), 1e-6) << trial;
    // The gain: the landmark eliminated from the information of all.
    MatrixXd H = J.transpose() * J;
    H.topLeftCorner(n, n) += symmetric_inverse(Sigma);
    const MatrixXd poses_then = symmetric_inverse(H).topLeftCorner(n, n);
    const double gain = 0.5 * (log_determinant_of(Sigma) - log_determinant_of(poses_then));
    EXPECT_NEAR(point->fit.gain, gain, 1e-4 * (1.0 + gain)) << trial;
    EXPECT_GE(point->fit.gain, 0.0);
    // The innovation: what no step of all explains, by the priors of the poses.
    VectorXd g = J.transpose() * e;
    const double innovation = e.squaredNorm() - g.dot(symmetric_inverse(H) * g);
    EXPECT_NEAR(point->fit.innovation, innovation, 1e-3 * (1.0 + innovation)) << trial;
    EXPECT_EQ(point->fit.dof, count - 2);
  }
  EXPECT_EQ(compared, 30);
}

}  // namespace
}  // namespace cairn::compact
