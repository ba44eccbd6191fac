// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/pose.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "cairn/geometry/state_group.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/lie/se2.hpp"
#include "cairn/lie/se3.hpp"
#include "cairn/types/define_variable.hpp"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

TEST(Pose, APointHasAPositionAndNoOrientation) {
  const auto pose = define_variable<Se2>(), point = define_variable<PointXYZ>();
  EXPECT_TRUE(is_pose(*pose) && has_position(*pose) && has_orientation(*pose));
  EXPECT_FALSE(is_point(*pose));
  EXPECT_TRUE(is_point(*point) && has_position(*point));
  EXPECT_FALSE(is_pose(*point) || has_orientation(*point));
}

TEST(Pose, CovarianceOfThePositionIsInTheWorldFrame) {
  const auto type = define_variable<Se2>();
  const std::array x{1.0, 2.0, 0.6};
  Matrix3d Sigma;
  Sigma << 4, 0.5, 0.1, 0.5, 1, 0.2, 0.1, 0.2, 0.3;
  const std::vector<double> world =
      position_covariance(*type, x, {Sigma.data(), static_cast<std::size_t>(Sigma.size())});
  const Eigen::Matrix2d R = Eigen::Rotation2Dd(0.6).toRotationMatrix();
  const Eigen::Matrix2d expected = R * Sigma.topLeftCorner<2, 2>() * R.transpose();
  ASSERT_EQ(world.size(), 4u);
  EXPECT_LE((Eigen::Map<const Eigen::Matrix2d>(world.data()) - expected).norm(), 1e-8);
}

TEST(Pose, OfThePlaneTurnsAboutZ) {
  const auto type = define_variable<Se2>();
  const std::array x{1.0, -2.0, 0.3};
  const Pose pose = pose_of(*type, x);
  EXPECT_LT((pose.t - Vector3d(1.0, -2.0, 0.0)).norm(), 1e-15);
  const Matrix3d R = Eigen::AngleAxisd(0.3, Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_LT((pose.R - R).norm(), 1e-15);
  EXPECT_EQ(position(*type, x), pose.t);
}

TEST(Pose, OfAPointIsNotTurned) {
  const auto type = define_variable<PointXYZ>();
  const std::array x{1.0, -2.0, 0.5};
  EXPECT_EQ(pose_of(*type, x).R, Matrix3d::Identity());
  EXPECT_EQ(position(*type, x), Vector3d(1.0, -2.0, 0.5));
}

// The arc cosine of the trace would give 0 for the first, and half of the digits of the others.
TEST(Pose, AngleIsExactNearNoTurnAndHalfATurn) {
  const Vector3d axis = Vector3d(1.0, -2.0, 0.5).normalized();
  for (const double angle : {1e-12, 1e-8, 1e-4, 0.5, 2.0, 3.1, std::numbers::pi - 1e-8}) {
    const Matrix3d R = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    EXPECT_NEAR(rotation_angle(R), angle, 1e-15 + 1e-14 * angle) << angle;
  }
  EXPECT_EQ(rotation_angle(Matrix3d::Identity()), 0.0);
  const Matrix3d half = Eigen::Vector3d(-1.0, -1.0, 1.0).asDiagonal();
  EXPECT_EQ(rotation_angle(half), std::numbers::pi);
}

template <class Group>
void expect_group(const Group& group) {
  typename Group::Tangent a(group.tangent_size()), b(group.tangent_size());
  for (int k = 0; k < group.tangent_size(); ++k) {
    a[k] = 0.3 * std::sin(1.0 + k);
    b[k] = 0.4 * std::cos(2.0 + 3.0 * k);
  }
  const auto x = group.exp(a), y = group.exp(b);
  EXPECT_LT((group.log(x) - a).norm(), 1e-14);
  EXPECT_LT(group.log(group.compose(x, group.inverse(x))).norm(), 1e-14);
  EXPECT_LT((group.log(group.compose(x, group.between(x, y))) - b).norm(), 1e-14);
  EXPECT_LT(group.log(group.identity()).norm(), 1e-15);
  // x exp(b) x⁻¹ = exp(Ad(x) b)
  const typename Group::Tangent turned = group.adjoint(x) * b;
  EXPECT_LT((group.log(group.compose(group.compose(x, y), group.inverse(x))) - turned).norm(),
            1e-13);
  EXPECT_EQ(group.view(x).size(), static_cast<std::size_t>(group.ambient_size()));
  EXPECT_EQ(group.state(group.view(x)), x);
}

TEST(StateGroup, ComposesStatesByValue) {
  const auto planar = define_variable<Se2>(), spatial = define_variable<Se3>();
  expect_group(StateGroup(*planar));
  expect_group(StateGroup(*spatial));
  expect_group(PoseGroup(*planar));
  expect_group(PoseGroup(*spatial));
}

}  // namespace
}  // namespace cairn
