// SPDX-License-Identifier: BSD-3-Clause
// Cameras and what they see, against formulas written down again from the paper, with angle and
// axis, R and T, as its files have them.
#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/Geometry>

#include "bundle/reprojection.hpp"
#include "cairn/evaluation/check_factor.hpp"
#include "cairn/types/autodiff.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

using bundle::Camera;
using bundle::Reprojection;
using CameraState = Vector<double, 10>;
using Point = Vector<double, 3>;
using Pixel = Vector<double, 2>;

/// A camera as files have it: P = R X + T.
struct BalCamera {
  Eigen::Vector3d omega, T;
  double f, k1, k2;

  Eigen::Matrix3d R() const {
    const double angle = omega.norm();
    return angle > 0.0 ? Eigen::AngleAxisd(angle, omega / angle).toRotationMatrix()
                       : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  }
  CameraState state() const {
    CameraState x;
    x << f, k1, k2, -R().transpose() * T, Eigen::Quaterniond(R().transpose()).coeffs();
    return x;
  }
  Pixel project(const Point& X) const {
    const Eigen::Vector3d P = R() * X + T;
    const Pixel p = -P.head<2>() / P[2];
    const double n = p.squaredNorm();
    return f * (1.0 + k1 * n + k2 * n * n) * p;
  }
};

/// Somewhere, turned anyhow, with a lens like those of the data sets.
BalCamera some_camera(Sampler& sampler, double angle = 2.0) {
  const auto omega = sampler.direction(3, angle), T = sampler.vector(3, 5.0);
  return {{omega[0], omega[1], omega[2]},
          {T[0], T[1], T[2]},
          sampler.uniform(300.0, 1500.0),
          sampler.uniform(-0.2, 0.2),
          sampler.uniform(-0.05, 0.05)};
}

/// A point whose P_z is between −10 and −1, or with `behind` between 1 and 10.
Point seen_by(const BalCamera& camera, Sampler& sampler, bool behind = false) {
  const double depth = sampler.uniform(1.0, 10.0), z = behind ? depth : -depth;
  const Eigen::Vector3d P(depth * sampler.uniform(-0.6, 0.6), depth * sampler.uniform(-0.6, 0.6),
                          z);
  return camera.R().transpose() * (P - camera.T);
}

Pixel residual(const CameraState& camera, const Point& X, const Pixel& z) {
  return Reprojection::residual<double>(camera, X, z);
}

TEST(Reprojection, IsTheProjectionOfThePaper) {
  Sampler sampler(5);
  for (const double angle : {0.0, 1e-9, 0.1, 2.0, 3.14159}) {
    for (int k = 0; k < 20; ++k) {
      const BalCamera camera = some_camera(sampler, angle);
      const Point X = seen_by(camera, sampler);
      const Pixel z(sampler.uniform(-400.0, 400.0), sampler.uniform(-400.0, 400.0));
      const Pixel expected = camera.project(X) - z;
      EXPECT_LT((residual(camera.state(), X, z) - expected).norm(), 1e-11 * (1 + expected.norm()));
    }
  }
}

// Numbers worked out by hand: the point (1, 2, −4) seen by a camera at the origin.
TEST(Reprojection, PutsAPointToTheRightAndAboveThere) {
  CameraState camera = Camera::identity();
  const Point X(1.0, 2.0, -4.0);
  camera[0] = 100.0;
  EXPECT_LT((residual(camera, X, Pixel(20.0, 51.0)) - Pixel(5.0, -1.0)).norm(), 1e-13);
  camera[1] = 0.32;   // ‖p‖² = 0.3125
  camera[2] = 1.024;  // ‖p‖⁴ = 0.09765625; 1 + 0.1 + 0.1
  EXPECT_LT((residual(camera, X, Pixel(0.0, 0.0)) - Pixel(30.0, 60.0)).norm(), 1e-13);
}

TEST(Reprojection, HasTheJacobiansOfDualNumbersAndOfDifferences) {
  Sampler sampler(17);
  const auto type = define_factor<Reprojection>();
  const auto camera_type = define_variable<Camera>();
  const auto point_type = define_variable<PointXYZ>();
  for (int k = 0; k < 200; ++k) {
    const BalCamera camera = some_camera(sampler, sampler.uniform(0.0, 3.1));
    const CameraState x = camera.state();
    const Point X = seen_by(camera, sampler, k % 4 == 0);  // behind it now and then
    const Pixel z(sampler.uniform(-400.0, 400.0), sampler.uniform(-400.0, 400.0));

    std::tuple<Eigen::Matrix<double, 2, 9>, Eigen::Matrix<double, 2, 3>> analytic, automatic;
    const Pixel r = Reprojection::evaluate(x, X, z, std::get<0>(analytic), std::get<1>(analytic));
    const Pixel r_automatic = autodiff::evaluate<Reprojection>(std::tuple(x, X), z, automatic);
    EXPECT_LT((r - residual(x, X, z)).norm(), 1e-13 * (10.0 + r.norm() + z.norm()));
    EXPECT_LT((r - r_automatic).norm(), 1e-13 * (10.0 + r.norm() + z.norm()));
    // Column by column: that of f is a thousandth of the others.
    for (int c = 0; c < 9; ++c) {
      const auto a = std::get<0>(analytic).col(c), b = std::get<0>(automatic).col(c);
      EXPECT_LT((a - b).norm(), 1e-12 * (0.01 + b.norm())) << "camera, column " << c;
    }
    EXPECT_LT((std::get<1>(analytic) - std::get<1>(automatic)).norm(),
              1e-12 * (1.0 + std::get<1>(automatic).norm()));

    const VariableType* const variables[] = {camera_type.get(), point_type.get()};
    const double* const states[] = {x.data(), X.data()};
    EXPECT_LT(check_factor(*type, variables, states, {z.data(), 2}).largest_deviation, 1e-8);
  }
}

// A step (f k1 k2, v, ω) moves the camera as a pose: its position by R v, its axes by exp(ω).
TEST(Camera, MovesAsAPoseDoes) {
  Sampler sampler(3);
  const BalCamera camera = some_camera(sampler);
  const CameraState x = camera.state();
  Vector<double, 9> delta = Vector<double, 9>::Zero();
  delta.head<3>() << 10.0, 0.01, -0.02;
  delta.segment<3>(3) << 1.0, 2.0, 3.0;
  const CameraState moved = Camera::retract<double>(x, delta);
  EXPECT_LT((moved.head<3>() - x.head<3>() - delta.head<3>()).norm(), 1e-12);
  const Eigen::Vector3d expected = x.segment<3>(3) + camera.R().transpose() * delta.segment<3>(3);
  EXPECT_LT((moved.segment<3>(3) - expected).norm(), 1e-12);

  delta.setZero();
  delta.tail<3>() << 0.1, -0.2, 0.3;
  const CameraState turned = Camera::retract<double>(x, delta);
  EXPECT_LT((turned.segment<3>(3) - x.segment<3>(3)).norm(), 1e-12);
  const Eigen::Vector3d omega = delta.tail<3>();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(omega.norm(), omega.normalized()).matrix();
  EXPECT_LT((Camera::rotation(turned) - camera.R().transpose() * turn).norm(), 1e-12);
}

TEST(Camera, IsPlacedWhereItsCentreIs) {
  Sampler sampler(4);
  const BalCamera camera = some_camera(sampler);
  const auto type = define_variable<Camera>();
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  type->placement()->split(camera.state().data(), R.data(), t.data());
  EXPECT_LT((camera.R() * t + camera.T).norm(), 1e-12) << "P = R X + T is zero in the centre";
  EXPECT_LT((R - camera.R().transpose()).norm(), 1e-12);
}

TEST(Camera, IsNoGroupSinceNoMotionOfTheWorldChangesItsLens) {
  EXPECT_EQ(define_variable<Camera>()->lie_group(), nullptr);
}

TEST(Camera, RefusesAFocalLengthOfZero) {
  CameraState x = Camera::identity();
  x[0] = 0.0;
  EXPECT_EQ(Camera::normalize(x), "the focal length is zero");
  x[0] = 2.0;
  x.tail<4>() *= -3.0;
  EXPECT_EQ(Camera::normalize(x), "");
  EXPECT_EQ(x[9], 1.0) << "a unit quaternion with w >= 0";
}

// What other programs minimise: the formula as it stands.
TEST(Reprojection, MirrorsWhatIsBehindTheCamera) {
  Sampler sampler(6);
  const BalCamera camera = some_camera(sampler);
  const Point X = seen_by(camera, sampler, true);
  const Point opposite = camera.R().transpose() * (-(camera.R() * X + camera.T) - camera.T);
  const Pixel nothing = Pixel::Zero();
  EXPECT_LT((residual(camera.state(), X, nothing) - camera.project(X)).norm(), 1e-9);
  EXPECT_LT(
      (residual(camera.state(), X, nothing) - residual(camera.state(), opposite, nothing)).norm(),
      1e-9);
}

// Where the formula does not hold any more: near the plane of the camera, and far from the axis.
TEST(Reprojection, HasJacobiansWhereThereIsNoImage) {
  Sampler sampler(8);
  CameraState camera = Camera::identity();
  camera.head<3>() << 500.0, -0.1, 0.01;
  const Pixel z(1.0, 2.0);
  for (int k = 0; k < 200; ++k) {
    Point X(sampler.uniform(-3.0, 3.0), sampler.uniform(-3.0, 3.0), 0.0);
    const double aside = std::abs(X[0]) + std::abs(X[1]);
    const bool in_plane = k % 2 == 0;
    X[2] = in_plane ? sampler.uniform(-0.99e-4, 0.99e-4) * aside
                    : X.norm() / sampler.uniform(k % 4 == 1 ? -2.8 : 2.0, k % 4 == 1 ? -2.0 : 2.8);
    EXPECT_EQ(Reprojection::in_plane<double>(X), in_plane);
    std::tuple<Eigen::Matrix<double, 2, 9>, Eigen::Matrix<double, 2, 3>> analytic, automatic;
    const Pixel r =
        Reprojection::evaluate(camera, X, z, std::get<0>(analytic), std::get<1>(analytic));
    const Pixel r_automatic = autodiff::evaluate<Reprojection>(std::tuple(camera, X), z, automatic);
    EXPECT_EQ(r, residual(camera, X, z));
    EXPECT_LT((r - r_automatic).norm(), 1e-13 * (10.0 + r.norm()));
    for (int c = 0; c < 9; ++c) {
      const auto a = std::get<0>(analytic).col(c), b = std::get<0>(automatic).col(c);
      EXPECT_LT((a - b).norm(), 1e-11 * (1.0 + b.norm())) << "camera, column " << c;
    }
    EXPECT_LT((std::get<1>(analytic) - std::get<1>(automatic)).norm(),
              1e-11 * (1.0 + std::get<1>(automatic).norm()));
    // In the plane the error falls along its Jacobian, towards the front.
    if (in_plane && X[2] < 0.0) {
      EXPECT_LT(residual(camera, X - Point(0, 0, 1e-6 * aside), z).norm(), r.norm());
    }
  }
}

TEST(Reprojection, GoesOverIntoAPinholeWithoutAStep) {
  CameraState camera = Camera::identity();
  camera.head<3>() << 500.0, -0.1, 0.01;
  const Pixel z(0.0, 0.0);
  for (const double square : {Reprojection::kField, Reprojection::kBeyond}) {
    const double at = std::sqrt(square);
    const Pixel before = residual(camera, Point(at * (1.0 - 1e-9), 0.0, -1.0), z),
                after = residual(camera, Point(at * (1.0 + 1e-9), 0.0, -1.0), z);
    EXPECT_LT((after - before).norm(), 1e-4) << square;
  }
  EXPECT_LT((residual(camera, Point(3.0, 0.0, -1.0), z) - Pixel(1500.0, 0.0)).norm(), 1e-9);
}

TEST(Reprojection, SaysWhereNothingIsSeen) {
  const CameraState camera = Camera::identity();
  const auto outside = [&](const Point& X) {
    const double* const x[] = {camera.data(), X.data()};
    return Reprojection::outside(x);
  };
  EXPECT_EQ(outside({1, 2, -4}), "");
  EXPECT_EQ(outside({1, 2, 4}), "the point is behind the camera, which cannot see it");
  for (const Point& X : {Point(1, 2, 0), Point(1, 2, -1e-5), Point(0, 0, 0)})
    EXPECT_EQ(outside(X), "the point is in the plane of the camera, and has no image");
  Point placed;
  const Point behind(1, 2, 4);
  const double* const x[] = {camera.data(), behind.data()};
  const Pixel z(0.25, 0.5);
  ASSERT_TRUE(Reprojection::place(1, x, z.data(), 8.0, placed.data()));
  EXPECT_NEAR(placed.norm(), 8.0, 1e-12);
  EXPECT_LT(residual(camera, placed, z).norm(), 1e-12);
  EXPECT_FALSE(Reprojection::place(0, x, z.data(), 8.0, placed.data()));
}

TEST(Reprojection, StaysANumberWhereThereIsNoImage) {
  CameraState camera = Camera::identity();
  camera[0] = 500.0;
  camera[1] = -0.1;
  camera[2] = 0.01;
  const Pixel z(1.0, 2.0);
  const Point places[] = {{0, 0, 0},      {1, 2, 0},      {1, 2, -0.0},   {1, 2, 1e-300},
                          {1, 2, -1e-14}, {1e-200, 0, 0}, {0, 0, 1e-320}, {1e9, -1e9, 1e-9}};
  for (const Point& X : places) {
    Eigen::Matrix<double, 2, 9> J_camera;
    Eigen::Matrix<double, 2, 3> J_point;
    const Pixel r = Reprojection::evaluate(camera, X, z, J_camera, J_point);
    EXPECT_TRUE(r.allFinite()) << X.transpose();
    EXPECT_EQ(r, residual(camera, X, z)) << X.transpose();
    EXPECT_TRUE(J_camera.allFinite() && J_point.allFinite()) << X.transpose();
    const bool centre = X.norm() < Reprojection::kCentre;
    EXPECT_TRUE(centre || r.norm() > 1e6) << "no step goes there: " << X.transpose();
  }
}

}  // namespace
}  // namespace cairn::test
