// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/lie/so2.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "cairn/pack/dual.hpp"

namespace cairn::so2 {
namespace {

TEST(CosSin, AgreesWithTheCLibraryToTheLastDigit) {
  std::mt19937_64 rng(17);
  double worst = 0.0;
  const auto compare = [&](double angle) {
    double c, s;
    cos_sin(angle, c, s);
    worst = std::max({worst, std::abs(c - std::cos(angle)), std::abs(s - std::sin(angle))});
  };
  for (const double range : {1e-9, 0.8, 4.0, 1000.0, 1e9}) {
    std::uniform_real_distribution<double> angles(-range, range);
    for (int k = 0; k < 100000; ++k) compare(angles(rng));
  }
  for (int quarter = -640; quarter <= 640; ++quarter) {
    for (const double beside : {-1e-8, 0.0, 1e-8})
      compare(quarter * (std::numbers::pi / 4) + beside);
  }
  EXPECT_LE(worst, 2.3e-16);
}

TEST(CosSin, IsExactAtZeroAndNeverAnswersForWhatIsNoAngle) {
  double c, s;
  cos_sin(0.0, c, s);
  EXPECT_EQ(c, 1.0);
  EXPECT_EQ(s, 0.0);
  for (const double angle : {std::numeric_limits<double>::infinity(), std::nan("")}) {
    cos_sin(angle, c, s);
    EXPECT_TRUE(std::isnan(c) && std::isnan(s));
  }
}

TEST(PolarAngle, AgreesWithTheCLibraryToThreeUnitsInTheLastPlace) {
  std::mt19937_64 rng(23);
  double worst = 0.0;
  const auto compare = [&](double y, double x) {
    const double right = std::atan2(y, x);
    const double unit = std::nextafter(std::abs(right), 4.0) - std::abs(right);
    worst = std::max(worst, std::abs(polar_angle(y, x) - right) / unit);
  };
  std::uniform_real_distribution<double> side(-1.0, 1.0), power(-300.0, 300.0);
  for (int k = 0; k < 300000; ++k) {
    compare(side(rng), side(rng));
    compare(side(rng) * std::pow(10.0, power(rng)), side(rng));
    compare(side(rng), side(rng) * std::pow(10.0, power(rng)));
    const double scale = std::pow(10.0, power(rng));
    compare(side(rng) * scale, side(rng) * scale);
  }
  for (int sixteenth = -16; sixteenth <= 16; ++sixteenth) {
    const double angle = sixteenth * (std::numbers::pi / 16);
    compare(std::sin(angle), std::cos(angle));
  }
  EXPECT_LE(worst, 4.0);  // the library's own unit included
  EXPECT_EQ(polar_angle(0.0, 0.0), 0.0);
  EXPECT_EQ(polar_angle(0.0, -1.0), std::numbers::pi);
  EXPECT_TRUE(std::isnan(polar_angle(std::nan(""), 1.0)));
  EXPECT_TRUE(std::isnan(polar_angle(1.0, std::nan(""))));
}

TEST(PolarAngle, OfADualNumberHasTheSameValueAndTheRightDerivative) {
  const double y = -0.7, x = 0.3;
  const Dual<2> angle = polar_angle(Dual<2>::variable(y, 0), Dual<2>::variable(x, 1));
  EXPECT_EQ(angle.value, polar_angle(y, x));
  EXPECT_NEAR(angle.gradient[0], x / (x * x + y * y), 1e-15);
  EXPECT_NEAR(angle.gradient[1], -y / (x * x + y * y), 1e-15);
}

TEST(Rotation, OfADualNumberHasTheSameValueAndTheRightDerivative) {
  for (const double angle : {0.0, 0.3, -2.9, 17.0}) {
    const Rotation<double> plain(angle);
    const Rotation<Dual<1>> dual(Dual<1>::variable(angle, 0));
    EXPECT_EQ(dual.c.value, plain.c);
    EXPECT_EQ(dual.s.value, plain.s);
    EXPECT_EQ(dual.c.gradient[0], -plain.s);
    EXPECT_EQ(dual.s.gradient[0], plain.c);
  }
}

}  // namespace
}  // namespace cairn::so2
