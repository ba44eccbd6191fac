// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/lie/so3.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

#include "cairn/lie/so2.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector4d;

Vector3d rotation_vector(Sampler& sampler, const Regime& regime) {
  const auto v = sampler.direction(3, regime.angle < 0 ? sampler.uniform(0.0, 3.0) : regime.angle);
  return {v[0], v[1], v[2]};
}

template <class Check>
void in_every_regime(Check check) {
  Sampler sampler(2);
  for (const Regime& regime : regimes()) {
    SCOPED_TRACE(regime.name);
    for (int k = 0; k < 20; ++k) check(rotation_vector(sampler, regime));
  }
}

TEST(So3, HasTheExponentialOfTheMatrix) {
  in_every_regime([](const Vector3d& omega) {
    const Matrix3d expected = so3::hat<double>(omega).exp();
    EXPECT_LT((so3::matrix<double>(so3::exp<double>(omega)) - expected).norm(), 2e-14);
    EXPECT_NEAR(so3::exp<double>(omega).norm(), 1.0, 4e-16);
  });
}

TEST(So3, TakesTheShortWayBackForBothSignsOfAQuaternion) {
  in_every_regime([](const Vector3d& omega) {
    const Vector4d q = so3::exp<double>(omega);
    EXPECT_LE((so3::log<double>(q) - omega).norm(), 4e-15);
    EXPECT_LE((so3::log<double>(-q) - omega).norm(), 4e-15);
  });
  const Vector3d beyond = Vector3d(1, 2, 2) / 3 * 4.0;  // an angle over π
  EXPECT_LT((so3::log<double>(so3::exp<double>(beyond)) -
             Vector3d(1, 2, 2) / 3 * (4.0 - 2 * std::numbers::pi))
                .norm(),
            1e-14);
}

TEST(So3, HasAHalfTurnOfEitherSign) {
  const Vector3d half = Vector3d(1, -2, 2) / 3 * std::numbers::pi;
  const Vector3d back = so3::log<double>(so3::exp<double>(half));
  EXPECT_NEAR(back.norm(), std::numbers::pi, 1e-15);
  EXPECT_LT(std::min((back - half).norm(), (back + half).norm()), 1e-14);
  EXPECT_NEAR(so3::log<double>(Vector4d(0, 1, 0, 0))[1], std::numbers::pi, 1e-15);
  EXPECT_NEAR(so3::log<double>(Vector4d(0, 1, 0, -0.0))[1], std::numbers::pi, 1e-15);
}

TEST(So3, RotatesAsItsMatrixDoes) {
  in_every_regime([](const Vector3d& omega) {
    const Vector4d q = so3::exp<double>(omega);
    const Matrix3d R = so3::matrix<double>(q);
    const Vector3d v(0.3, -1.2, 2.0);
    EXPECT_LT((so3::rotate<double>(q, v) - R * v).norm(), 2e-15);
    EXPECT_LT((so3::rotate_back<double>(q, v) - R.transpose() * v).norm(), 2e-15);
    EXPECT_LT((so3::matrix<double>(so3::multiply<double>(q, q)) - R * R).norm(), 4e-15);
    EXPECT_LT((so3::matrix<double>(so3::from_matrix(R)) - R).norm(), 4e-15);
  });
}

/// The integral of exp(t ω) over t from 0 to 1 is J_l, by a series that knows no closed form.
Matrix3d left_jacobian_by_series(const Vector3d& omega) {
  const Matrix3d W = so3::hat<double>(omega);
  Matrix3d term = Matrix3d::Identity(), sum = term;
  for (int k = 2; k < 60; ++k) {
    term = term * W / k;
    sum += term;
  }
  return sum;
}

TEST(So3, HasTheJacobiansOfItsSeriesAndTheirInverses) {
  in_every_regime([](const Vector3d& omega) {
    const Matrix3d J_l = so3::left_jacobian(omega);
    EXPECT_LT((J_l - left_jacobian_by_series(omega)).norm(), 1e-13);
    EXPECT_LT((J_l.transpose() - so3::right_jacobian(omega)).norm(), 1e-15);
    EXPECT_LT((J_l * so3::inverse_left_jacobian(omega) - Matrix3d::Identity()).norm(), 1e-13);
    EXPECT_LT(
        (so3::right_jacobian(omega) * so3::inverse_right_jacobian(omega) - Matrix3d::Identity())
            .norm(),
        1e-13);
    const Vector3d v(0.3, -1.2, 2.0);
    EXPECT_LT((so3::left_jacobian_times<double>(omega, v) - J_l * v).norm(), 1e-14);
    EXPECT_LT((so3::inverse_left_jacobian_times<double>(omega, J_l * v) - v).norm(), 1e-13);
  });
}

TEST(So3, ReadsRollPitchYawInTheOrderOfTheFiles) {
  Sampler sampler(8);
  for (int k = 0; k < 100; ++k) {
    const double roll = sampler.uniform(-3.1, 3.1), pitch = sampler.uniform(-1.5, 1.5),
                 yaw = sampler.uniform(-3.1, 3.1);
    const Matrix3d R =
        (Eigen::AngleAxisd(yaw, Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Vector3d::UnitX()))
            .toRotationMatrix();
    const Vector4d q = so3::from_roll_pitch_yaw(roll, pitch, yaw);
    EXPECT_LT((so3::matrix<double>(q) - R).norm(), 1e-14);
    EXPECT_LT((so3::to_roll_pitch_yaw(q) - Vector3d(roll, pitch, yaw)).norm(), 1e-13);
  }
}

TEST(WrapAngle, StaysWithinHalfATurn) {
  using std::numbers::pi;
  EXPECT_EQ(wrap_angle(0.0), 0.0);
  EXPECT_EQ(wrap_angle(pi), pi);
  EXPECT_EQ(wrap_angle(-pi), -pi);
  EXPECT_NEAR(wrap_angle(pi + 0.25), 0.25 - pi, 1e-15);
  EXPECT_NEAR(wrap_angle(-pi - 0.25), pi - 0.25, 1e-15);
  for (double angle = -1e4; angle < 1e4; angle += 7.3) {
    const double wrapped = wrap_angle(angle);
    EXPECT_LE(std::abs(wrapped), pi);
    EXPECT_NEAR(std::sin(wrapped), std::sin(angle), 1e-11);
    EXPECT_NEAR(std::cos(wrapped), std::cos(angle), 1e-11);
  }
}

}  // namespace
}  // namespace cairn::test
