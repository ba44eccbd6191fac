// SPDX-License-Identifier: BSD-3-Clause
#include "portable_math.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "random.hpp"

namespace cairn::generate {
namespace {

constexpr double kUlp = 2.3e-16;

TEST(PortableMath, SineAndCosineAgreeWithTheLibrary) {
  for (int k = -20000; k <= 20000; ++k) {
    const double angle = 0.0013 * k;
    const SinCos r = sin_cos(angle);
    EXPECT_NEAR(r.sin, std::sin(angle), 2 * kUlp) << angle;
    EXPECT_NEAR(r.cos, std::cos(angle), 2 * kUlp) << angle;
  }
  EXPECT_NEAR(sin_cos(12345.678).sin, std::sin(12345.678), 4 * kUlp);
}

TEST(PortableMath, QuarterTurnsKeepTheirTinyRemainder) {
  EXPECT_NEAR(sin_cos(kPi).sin / std::sin(kPi), 1.0, 1e-10);
  EXPECT_NEAR(sin_cos(kPi / 2).cos / std::cos(kPi / 2), 1.0, 1e-10);
}

TEST(PortableMath, LogarithmAgreesWithTheLibrary) {
  for (double x = 1e-300; x < 1e300; x *= 1.37) {
    EXPECT_NEAR(natural_log(x), std::log(x), 4 * kUlp * std::fabs(std::log(x)) + kUlp) << x;
  }
  EXPECT_EQ(natural_log(1.0), 0.0);
}

TEST(PortableMath, ArcTangentAgreesWithTheLibraryInAllQuadrants) {
  for (int k = -3141; k <= 3141; ++k) {
    const double angle = 0.001 * k;
    const double y = 3.0 * std::sin(angle), x = 3.0 * std::cos(angle);
    EXPECT_NEAR(arc_tangent(y, x), std::atan2(y, x), 6 * kUlp) << angle;
  }
  EXPECT_EQ(arc_tangent(0.0, 2.0), 0.0);
  EXPECT_NEAR(arc_tangent(0.0, -2.0), kPi, kUlp);
  EXPECT_EQ(arc_tangent(0.0, 0.0), 0.0);
}

TEST(PortableMath, WrappedAnglesLieInOneTurn) {
  for (int k = -100; k <= 100; ++k) {
    const double wrapped = wrap_angle(0.77 * k);
    EXPECT_GE(wrapped, -kPi);
    EXPECT_LT(wrapped, kPi);
    EXPECT_NEAR(std::sin(wrapped), std::sin(0.77 * k), 1e-13);
  }
  EXPECT_EQ(wrap_angle(1.25), 1.25) << "an angle that is wrapped must not change";
}

TEST(Random, GaussianHasTheMomentsOfTheNormalDistribution) {
  Random random(1, Random::Stream::noise);
  constexpr int kN = 200000;
  double mean = 0.0, square = 0.0, fourth = 0.0;
  for (int k = 0; k < kN; ++k) {
    const double x = random.gaussian();
    mean += x / kN;
    square += x * x / kN;
    fourth += x * x * x * x / kN;
  }
  EXPECT_NEAR(mean, 0.0, 5.0 / std::sqrt(kN));
  EXPECT_NEAR(square, 1.0, 5.0 * std::sqrt(2.0 / kN));
  EXPECT_NEAR(fourth, 3.0, 5.0 * std::sqrt(96.0 / kN));
}

TEST(Random, StreamsOfOneSeedDiffer) {
  Random a(1, Random::Stream::noise), b(1, Random::Stream::loops), c(2, Random::Stream::noise);
  const double first = a.uniform();
  EXPECT_NE(first, b.uniform());
  EXPECT_NE(first, c.uniform());
}

}  // namespace
}  // namespace cairn::generate
