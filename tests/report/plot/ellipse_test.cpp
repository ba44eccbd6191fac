// SPDX-License-Identifier: BSD-3-Clause
#include "ellipse.hpp"

#include <array>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>
#include <Eigen/LU>

namespace cairn::plot {
namespace {

using ::testing::IsEmpty;

TEST(Ellipse, ItsCornersAreAsFarFromTheMeanAsAskedFor) {
  for (const double correlation : {0.0, 0.6, -0.99}) {
    const PlanarCovariance S{4.0, correlation * 6.0, 9.0};
    Eigen::Matrix2d dense;
    dense << S.xx, S.xy, S.xy, S.yy;
    const Eigen::Matrix2d inverse = dense.inverse();
    const auto corners = ellipse(S, 3.0);
    EXPECT_GE(corners.size(), 12U);
    double widest = 0.0;
    for (const auto& [x, y] : corners) {
      const Eigen::Vector2d p(x, y);
      EXPECT_NEAR(p.dot(inverse * p), 9.0, 1e-9);
      widest = std::max(widest, std::abs(x));
    }
    EXPECT_NEAR(widest, 6.0, 0.1);  // three standard deviations of x
  }
}

TEST(Ellipse, OfOneDirectionIsALine) {
  for (const auto& [x, y] : ellipse({0.0, 0.0, 4.0}, 1.0)) {
    EXPECT_EQ(x, 0.0);
    EXPECT_LE(std::abs(y), 2.0);
  }
}

TEST(Ellipse, OfWhatIsNoCovarianceIsNothing) {
  EXPECT_THAT(ellipse({-1.0, 0.0, 1.0}, 1.0), IsEmpty());
  EXPECT_THAT(ellipse({std::numeric_limits<double>::quiet_NaN(), 0.0, 1.0}, 1.0), IsEmpty());
  EXPECT_THAT(ellipse({1.0, std::numeric_limits<double>::infinity(), 1.0}, 1.0), IsEmpty());
}

TEST(Ellipse, InSpaceIsProjectedAsTheCovarianceIs) {
  const std::array<float, 6> upper{4, 1, -0.5F, 3, 0.25F, 2};
  Eigen::Matrix3d S;
  S << 4, 1, -0.5, 1, 3, 0.25, -0.5, 0.25, 2;
  const std::array<std::array<double, 3>, 2> rows{{{0.3, -0.8, 0.1}, {0.5, 0.2, 0.9}}};
  Eigen::Matrix<double, 2, 3> P;
  P << 0.3, -0.8, 0.1, 0.5, 0.2, 0.9;
  const Eigen::Matrix2d expected = P * S * P.transpose();
  const PlanarCovariance found = projected(rows, upper.data());
  EXPECT_NEAR(found.xx, expected(0, 0), 1e-12);
  EXPECT_NEAR(found.xy, expected(0, 1), 1e-12);
  EXPECT_NEAR(found.yy, expected(1, 1), 1e-12);
}

}  // namespace
}  // namespace cairn::plot
