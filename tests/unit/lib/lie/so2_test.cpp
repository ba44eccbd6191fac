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
