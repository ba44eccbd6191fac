// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pack/dual.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

#include "cairn/lie/so2.hpp"

namespace cairn::test {
namespace {

using D = Dual<2>;

/// f differentiates as differences of it over doubles show, at (x, y).
template <class F>
void expect_derivative(F f, double x, double y) {
  const D result = f(D::variable(x, 0), D::variable(y, 1));
  const double h = 1e-6;
  EXPECT_DOUBLE_EQ(result.value, f(x, y));
  EXPECT_NEAR(result.gradient[0], (f(x + h, y) - f(x - h, y)) / (2 * h), 1e-8);
  EXPECT_NEAR(result.gradient[1], (f(x, y + h) - f(x, y - h)) / (2 * h), 1e-8);
}

TEST(Dual, DifferentiatesArithmetic) {
  expect_derivative([](auto x, auto y) { return x + y; }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return x - y * 3.0; }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return 2.0 - x * y; }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return x / y + 1.0 / x; }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return -x * 2 / (y + 1); }, 0.7, 0.4);
  expect_derivative(
      [](auto x, auto y) {
        auto z = x;
        z += y;
        z *= x;
        z -= y;
        z /= x + y;
        return z;
      },
      0.7, 0.4);
}

TEST(Dual, DifferentiatesFunctions) {
  using namespace std;
  expect_derivative([](auto x, auto y) { return sin(x) * cos(y) + tan(x * y); }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return asin(x) + acos(x * y) + atan(y); }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return atan2(x, y) + atan2(-x, -y); }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return sqrt(x) + exp(y) * log(x); }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return pow(x, y) + pow(x, 2.5); }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return sinh(x) * cosh(y) + tanh(x); }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return hypot(x, y) + abs(-x) + fmod(x, 0.5); }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return max(x, y) * 2.0 + min(x, y); }, 0.7, 0.4);
  expect_derivative([](auto x, auto y) { return wrap_angle(x * 9.0 + y); }, 0.7, 0.4);
}

TEST(Dual, ComparesByValue) {
  const D a(1.0), b = D::variable(2.0, 0);
  EXPECT_TRUE(a < b && b > a && a <= b && a != b && b == 2.0 && 1.5 < b && a < 1.5);
  const D larger = a < b ? b : D(0.0);
  EXPECT_EQ(larger.gradient[0], 1.0);
}

TEST(Dual, LivesInEigenMatricesAndMixesWithNumbers) {
  Eigen::Matrix<D, 2, 1> v(D::variable(0.3, 0), D::variable(-0.8, 1));
  Eigen::Matrix2d A;
  A << 1, 2, 3, 4;
  const Eigen::Matrix<D, 2, 1> product = A * v * 2.0;
  EXPECT_NEAR(product[1].value, 2 * (3 * 0.3 - 4 * 0.8), 1e-15);
  EXPECT_EQ(product[1].gradient, (std::array<double, 2>{6, 8}));
  const D norm = v.norm();
  EXPECT_NEAR(norm.gradient[0], 0.3 / std::hypot(0.3, 0.8), 1e-15);
  const Eigen::Matrix<D, 3, 1> a(v[0], v[1], D(1.0)), b(D(0.5), v[0], v[1]);
  const D zero = a.cross(b).dot(a);
  EXPECT_NEAR(zero.gradient[0], 0.0, 1e-15);
  EXPECT_NEAR(zero.gradient[1], 0.0, 1e-15);
}

}  // namespace
}  // namespace cairn::test
