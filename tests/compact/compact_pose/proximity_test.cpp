// SPDX-License-Identifier: BSD-3-Clause
#include "proximity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <boost/math/distributions/normal.hpp>

#include <Eigen/Dense>

#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Draw;
using test::numerical_jacobian;
using test::PoseWorld;
using test::types_of;
constexpr double kPi = std::numbers::pi;

// One dimension -----------------------------------------------------------------------------------

/// ∫ N(x; μ, σ²) over (−v, v), by Simpson's rule.
double integral(double mean, double sigma, double v) {
  const double low = std::max(-v, mean - 12.0 * sigma), high = std::min(v, mean + 12.0 * sigma);
  if (low >= high) return 0.0;
  constexpr int kSteps = 4000;
  const double h = (high - low) / kSteps;
  double sum = 0.0;
  for (int k = 0; k <= kSteps; ++k) {
    const double x = (low + k * h - mean) / sigma;
    sum += std::exp(-0.5 * x * x) * (k == 0 || k == kSteps ? 1.0 : k % 2 == 1 ? 4.0 : 2.0);
  }
  return sum * h / 3.0 / (sigma * std::sqrt(2.0 * kPi));
}

TEST(Proximity, ProbabilityIsTheIntegralOfTheGaussian) {
  Draw draw(1);
  for (int trial = 0; trial < 300; ++trial) {
    const double mean = draw.uniform(-4.0, 4.0), sigma = std::exp(draw.uniform(-4.0, 2.0)),
                 v = draw.uniform(0.0, 4.0);
    EXPECT_NEAR(probability_within(mean, sigma, v), integral(mean, sigma, v), 1e-8);
    const boost::math::normal normal(mean, sigma);
    EXPECT_NEAR(probability_within(mean, sigma, v), cdf(normal, v) - cdf(normal, -v), 1e-14);
  }
}

TEST(Proximity, SmallProbabilitiesKeepTheirDigits) {
  // Between 9 and 11 standard deviations, from tables.
  EXPECT_NEAR(probability_within(10.0, 1.0, 1.0) / (1.1285884059538324e-19 - 1.91066e-28), 1.0,
              1e-12);
  EXPECT_EQ(probability_within(-10.0, 1.0, 1.0), probability_within(10.0, 1.0, 1.0));
}

TEST(Proximity, WithoutUncertaintyItIsAStep) {
  EXPECT_EQ(probability_within(0.99, 0.0, 1.0), 1.0);
  EXPECT_EQ(probability_within(-0.99, 0.0, 1.0), 1.0);
  EXPECT_EQ(probability_within(1.01, 0.0, 1.0), 0.0);
  EXPECT_EQ(range_within(-2.5, 0.0, 0.3), 2.5);
}

TEST(Proximity, TheRangeWithinIsTheSmallestThatDoes) {
  Draw draw(2);
  for (int trial = 0; trial < 300; ++trial) {
    const double mean = draw.uniform(-4.0, 4.0), sigma = std::exp(draw.uniform(-4.0, 2.0)),
                 s = draw.uniform(0.01, 0.99), v = range_within(mean, sigma, s);
    EXPECT_GE(probability_within(mean, sigma, v), s);
    EXPECT_LT(probability_within(mean, sigma, v - 1e-9 * (v + sigma)), s);
    EXPECT_EQ(range_within(-mean, sigma, s), v);
  }
}

TEST(Proximity, BeyondReachNoUncertaintyHelps) {
  Draw draw(3);
  for (const double s : {1e-6, 1e-3, 0.01, 0.1, 0.3, 0.45, 0.499, 0.5, 0.501, 0.7, 0.999}) {
    const double m = reach(s);
    EXPECT_GE(m, 1.0);
    for (int trial = 0; trial < 3000; ++trial) {
      const double v = std::exp(draw.uniform(-3.0, 3.0)),
                   mean = v * m * (1.0 + std::exp(draw.uniform(-30.0, 2.0))),
                   sigma = mean * std::exp(draw.uniform(-8.0, 3.0));
      EXPECT_LE(probability_within(mean, sigma, v), s) << "s " << s << ", mean " << mean;
    }
  }
}

TEST(Proximity, JustWithinReachSomeUncertaintyHelps) {
  for (const double s : {1e-6, 1e-3, 0.01, 0.1, 0.3, 0.45, 0.499, 0.5, 0.501, 0.7, 0.999}) {
    const double mean = reach(s) * (1.0 - 1e-5);
    double most = 0.0;
    for (double sigma = 1e-8; sigma < 1e8; sigma *= 1.001)
      most = std::max(most, probability_within(mean, sigma, 1.0));
    EXPECT_GT(most, s);
  }
}

TEST(Proximity, ReachIsInfiniteWhereNoProbabilityIsAskedFor) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(reach(0.0), kInfinity);
  EXPECT_EQ(reach(0.5), 1.0);
  EXPECT_EQ(reach(1.0), 1.0);
  EXPECT_EQ((SensorRange{.translation = {1.0, 2.0, 3.0}}).radius(3), kInfinity);
}

TEST(Proximity, TheRadiusHoldsTheCornersOfTheRange) {
  const SensorRange range{.translation = {3.0, 4.0, 12.0}, .probability = 0.7};
  EXPECT_DOUBLE_EQ(range.radius(2), 5.0);
  EXPECT_DOUBLE_EQ(range.radius(3), 13.0);
}

// Dimensions of a displacement --------------------------------------------------------------------

struct Moments {
  double mean = 0.0, sigma = 0.0;
};

class DistanceTestIn : public testing::TestWithParam<int> {
 protected:
  DistanceTest test(RotationTest rotation, int view_axis = 2) const {
    return {group,
            {.translation = {1.0, 2.0, 3.0},
             .rotation = 0.5,
             .probability = 0.2,
             .test = rotation,
             .view_axis = view_axis}};
  }
  Displacement displacement(const std::vector<double>& mean, const MatrixXd& covariance) const {
    Displacement d = group.displacement(group.place(group.state(world.identity())),
                                        group.place(group.state(mean)));
    d.covariance = covariance;
    return d;
  }
  /// To first order.
  template <class F>
  Moments propagated(const std::vector<double>& mean, const MatrixXd& covariance,
                     const F& f) const {
    const MatrixXd J = numerical_jacobian(world.tangent(), [&](const VectorXd& step) {
      return VectorXd::Constant(1, f(world.moved(mean, step)));
    });
    return {f(mean), std::sqrt((J * covariance * J.transpose())(0, 0))};
  }
  template <class F>
  Moments sampled(const std::vector<double>& mean, const MatrixXd& covariance, Draw& draw,
                  const F& f) const {
    constexpr int kSamples = 40'000;
    const MatrixXd L = covariance.llt().matrixL();
    double sum = 0.0, squares = 0.0;
    const double origin = f(mean);
    for (int k = 0; k < kSamples; ++k) {
      const double x = f(world.moved(mean, L * draw.normals(world.tangent()))) - origin;
      sum += x / kSamples, squares += x * x / kSamples;
    }
    return {origin + sum, std::sqrt(squares - sum * sum)};
  }
  Vector3d rotation_vector(const std::vector<double>& x) const {
    const Eigen::AngleAxisd turn(world.split(x).first);
    return turn.angle() * turn.axis();
  }

  Registry registry;
  PoseWorld world{types_of(GetParam(), registry)};
  RigidGroup group{world.types().pose};
};
INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, DistanceTestIn, testing::Values(2, 3));

TEST_P(DistanceTestIn, TranslationsAreSeenFromTheEarlierPose) {
  Draw draw(1);
  for (int trial = 0; trial < 20; ++trial) {
    const auto mean = world.random(draw, 3.0, 1.7);
    const MatrixXd Sigma = draw.covariance(world.tangent(), 0.1);
    const Dimensions d = test(RotationTest::magnitude).dimensions(displacement(mean, Sigma));
    ASSERT_EQ(d.translations, GetParam());
    for (int r = 0; r < d.translations; ++r) {
      const Moments expected = propagated(
          mean, Sigma, [&](const std::vector<double>& x) { return world.split(x).second[r]; });
      EXPECT_NEAR(d.t_mean[r], expected.mean, 1e-12);
      EXPECT_NEAR(d.t_sigma[r], expected.sigma, 1e-8);
    }
  }
}

TEST_P(DistanceTestIn, RotationsAreTheElementsOfTheRotationVector) {
  Draw draw(2);
  for (const double turn : {1e-12, 1e-4, 0.5, 1.7}) {
    const auto mean = world.random(draw, 3.0, turn);
    const MatrixXd Sigma = draw.covariance(world.tangent(), 0.1);
    const Dimensions d = test(RotationTest::elements).dimensions(displacement(mean, Sigma));
    ASSERT_EQ(d.rotations, GetParam() == 2 ? 1 : 3);
    for (int r = 0; r < d.rotations; ++r) {
      const int axis = GetParam() == 2 ? 2 : r;
      const Moments expected = propagated(
          mean, Sigma, [&](const std::vector<double>& x) { return rotation_vector(x)[axis]; });
      EXPECT_NEAR(d.r_mean[r], expected.mean, 1e-12);
      EXPECT_NEAR(d.r_sigma[r], expected.sigma, 1e-7);
    }
  }
}

TEST_P(DistanceTestIn, MagnitudeIsTheAngle) {
  Draw draw(3);
  for (const double turn : {0.01, 0.5, 1.7}) {
    const auto mean = world.random(draw, 3.0, turn);
    const MatrixXd Sigma = draw.covariance(world.tangent(), 0.1);
    const Dimensions d = test(RotationTest::magnitude).dimensions(displacement(mean, Sigma));
    ASSERT_EQ(d.rotations, 1);
    const Moments expected = propagated(
        mean, Sigma, [&](const std::vector<double>& x) { return rotation_vector(x).norm(); });
    EXPECT_NEAR(std::abs(d.r_mean[0]), expected.mean, 1e-12);
    EXPECT_NEAR(d.r_sigma[0], expected.sigma, 1e-7);
  }
}

// No direction is known in which an angle of zero grows.
TEST_P(DistanceTestIn, AnAngleOfZeroIsAsUncertainAsItsWorstAxis) {
  Draw draw(4);
  const MatrixXd Sigma = draw.covariance(world.tangent(), 0.1);
  const Dimensions d =
      test(RotationTest::magnitude).dimensions(displacement(world.identity(), Sigma));
  const auto twist = group.twist_covariance(Sigma);
  const Eigen::Matrix3d S = twist.bottomRightCorner<3, 3>();
  const double worst = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(S).eigenvalues().maxCoeff();
  EXPECT_EQ(d.r_mean[0], 0.0);
  EXPECT_NEAR(d.r_sigma[0], std::sqrt(worst), 1e-12);
}

TEST_P(DistanceTestIn, InThePlaneThereIsOneRotationWhateverTheTest) {
  if (GetParam() == 3) GTEST_SKIP() << "space";
  Draw draw(5);
  const Displacement d = displacement(world.random(draw, 2.0, 1.0), draw.covariance(3, 0.1));
  const Dimensions one = test(RotationTest::elements).dimensions(d);
  for (const RotationTest rotation : {RotationTest::magnitude, RotationTest::view}) {
    const Dimensions other = test(rotation).dimensions(d);
    EXPECT_EQ(other.rotations, 1);
    EXPECT_EQ(other.r_mean[0], one.r_mean[0]);
    EXPECT_EQ(other.r_sigma[0], one.r_sigma[0]);
    EXPECT_EQ(test(rotation).passes(other), test(RotationTest::elements).passes(one));
  }
}

// Where the directions agree the cosine is flat, and only the second order moves it.
TEST_P(DistanceTestIn, ViewIsTheCosineBetweenTheDirectionsToSecondOrder) {
  if (GetParam() == 2) GTEST_SKIP() << "plane";
  Draw draw(6);
  for (const int axis : {0, 1, 2}) {
    const auto cosine = [&](const std::vector<double>& x) {
      return world.split(x).first(axis, axis);
    };
    for (const double turn : {0.0, 0.02, 0.4, 1.7}) {
      // Also about the axis itself: a roll that changes no view.
      const auto mean = world.random(draw, 1.0, turn);
      const MatrixXd Sigma = draw.covariance(6, 0.08);
      const Dimensions d = test(RotationTest::view, axis).dimensions(displacement(mean, Sigma));
      ASSERT_EQ(d.rotations, 1);
      const Moments expected = sampled(mean, Sigma, draw, cosine);
      EXPECT_NEAR(d.r_sigma[0], expected.sigma, 0.04 * expected.sigma) << turn;
      EXPECT_NEAR(d.r_mean[0], expected.mean, 0.05 * expected.sigma) << turn;
    }
    // To first order where that counts: the covariance is tiny.
    const auto mean = world.random(draw, 1.0, 1.0);
    const MatrixXd Sigma = draw.covariance(6, 1e-4);
    const Dimensions d = test(RotationTest::view, axis).dimensions(displacement(mean, Sigma));
    const Moments expected = propagated(mean, Sigma, cosine);
    EXPECT_NEAR(d.r_sigma[0] / expected.sigma, 1.0, 1e-4);
    EXPECT_NEAR(d.r_mean[0], expected.mean, 1e-7);
  }
}

// The test ----------------------------------------------------------------------------------------

TEST_P(DistanceTestIn, PassesWhereEveryDimensionIsProbableEnough) {
  Draw draw(7);
  int passed = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const SensorRange range{.translation = {1.5, 2.0, 2.5},
                            .rotation = draw.uniform(0.3, 2.0),
                            .probability = draw.uniform(0.05, 0.9),
                            .test = RotationTest::magnitude};
    const DistanceTest test(group, range);
    const auto mean = world.random(draw, 2.5, 0.6);
    const Dimensions d = test.dimensions(displacement(mean, draw.covariance(world.tangent(), 0.3)));
    bool all = true;
    for (int r = 0; r < d.translations; ++r)
      all &= integral(d.t_mean[r], d.t_sigma[r], range.translation[r]) > range.probability;
    all &= integral(d.r_mean[0], d.r_sigma[0], range.rotation) > range.probability;
    EXPECT_EQ(test.passes(d), all);
    passed += all;
  }
  EXPECT_GT(passed, 50);
  EXPECT_LT(passed, 450);
}

TEST_P(DistanceTestIn, BesideAMeanOfZeroALargeDeviationAloneExcludesNobody) {
  Draw draw(12);
  int passed = 0, excluded = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const SensorRange range{.translation = {0.2, 0.3, 0.25},
                            .rotation = draw.uniform(0.3, 2.0),
                            .probability = draw.uniform(0.02, 0.4),
                            .test = RotationTest::magnitude};
    const DistanceTest test(group, range);
    const double scale = std::exp(draw.uniform(-4.0, 3.0));
    const auto mean = world.random(draw, 3.0 * std::sqrt(scale), 0.6);
    const Dimensions d =
        test.dimensions(displacement(mean, draw.covariance(world.tangent(), scale)));
    double product = 1.0;
    bool all = true;
    const auto include = [&](double off, double sigma, double v) {
      const double part = integral(off, sigma, v) / integral(0.0, sigma, v);
      all &= part > range.probability;
      product *= part;
    };
    for (int r = 0; r < d.translations; ++r)
      include(d.t_mean[r], d.t_sigma[r], range.translation[r]);
    include(d.r_mean[0], d.r_sigma[0], range.rotation);
    const std::optional<double> probability = test.relative_probability(d);
    ASSERT_EQ(probability.has_value(), all);
    if (!all) {
      EXPECT_FALSE(test.passes(d));
      continue;
    }
    EXPECT_NEAR(*probability, product, 1e-9);
    ++passed;
    excluded += !test.passes(d);
  }
  EXPECT_GT(passed, 50);
  EXPECT_GT(excluded, 20);
}

TEST_P(DistanceTestIn, ViewPassesWhereTheCosineIsProbablyLargeEnough) {
  if (GetParam() == 2) GTEST_SKIP() << "plane";
  Draw draw(8);
  int passed = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const SensorRange range{.translation = {9.0, 9.0, 9.0},
                            .rotation = draw.uniform(0.1, 1.5),
                            .probability = draw.uniform(0.05, 0.9),
                            .test = RotationTest::view};
    const DistanceTest test(group, range);
    const Dimensions d =
        test.dimensions(displacement(world.random(draw, 1.0, 0.8), draw.covariance(6, 0.3)));
    const boost::math::normal normal(d.r_mean[0], d.r_sigma[0]);
    const bool expected = cdf(complement(normal, std::cos(range.rotation))) > range.probability;
    EXPECT_EQ(test.passes(d), expected);
    passed += expected;
  }
  EXPECT_GT(passed, 50);
  EXPECT_LT(passed, 250);
}

TEST_P(DistanceTestIn, WhatIsImpossibleNeverPassesAndWhatPassesIsWithinTheRadius) {
  Draw draw(9);
  int impossible = 0, passed = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    const auto rotation = static_cast<RotationTest>(draw.integer(3));
    const SensorRange range{.translation = {1.0, 1.5, 2.0},
                            .rotation = draw.uniform(0.1, 3.15),
                            .probability = draw.chance(0.3) ? 0.5 : draw.uniform(1e-4, 0.9),
                            .test = rotation};
    const DistanceTest test(group, range);
    Displacement d = displacement(world.random(draw, 4.0, 1.7),
                                  draw.covariance(world.tangent(), std::exp(draw.uniform(-3, 2))));
    const bool passes = test.passes(test.dimensions(d));
    if (passes) {
      EXPECT_LE(d.at.t.norm(), range.radius(GetParam()));
      EXPECT_TRUE(test.possible(d.at));
    }
    passed += passes;
    impossible += !test.possible(d.at);
  }
  EXPECT_GT(passed, 300);
  EXPECT_GT(impossible, 300);
}

TEST_P(DistanceTestIn, AnyProbabilityWillDoIfNoneIsAskedFor) {
  const DistanceTest test(group, {.translation = {0.1, 0.1, 0.1}, .rotation = 0.01});
  Draw draw(10);
  const Displacement d =
      displacement(world.random(draw, 1000.0, 1.7), draw.covariance(world.tangent(), 1e-3));
  EXPECT_TRUE(test.possible(d.at));
  EXPECT_TRUE(test.passes(test.dimensions(d)));
}

TEST_P(DistanceTestIn, TheLeastRangeIsThatWithWhichItJustPasses) {
  Draw draw(11);
  for (int trial = 0; trial < 300; ++trial) {
    const auto rotation = static_cast<RotationTest>(draw.integer(3));
    const SensorRange range{.translation = {1e-3, 1e-3, 1e-3},
                            .rotation = 1e-3,
                            .probability = draw.uniform(0.02, 0.6),
                            .test = rotation};
    const DistanceTest test(group, range);
    const Dimensions d = test.dimensions(
        displacement(world.random(draw, 4.0, 1.0), draw.covariance(world.tangent(), 0.3)));
    const SensorRange least = test.least_range(d);
    const auto passes = [&](double translation, double angle) {
      SensorRange changed = least;
      for (double& v : changed.translation) v *= translation;
      changed.rotation *= angle;
      return DistanceTest(group, changed).passes(d);
    };
    EXPECT_TRUE(passes(1.0 + 1e-6, 1.0 + 1e-6));
    EXPECT_FALSE(passes(1.0 - 1e-6, 1.0 + 1e-6));
    // The Gaussian of a cosine reaches beyond 1, and may be probable enough there already.
    EXPECT_EQ(passes(1.0 + 1e-6, 1.0 - 1e-6), least.rotation < 1e-6);
  }
}

// No angle is larger than π, so a sensor that sees all around never loses a match by the rotation.
TEST_P(DistanceTestIn, AHalfTurnEachWayHoldsEveryRotation) {
  Draw draw(12);
  for (const auto rotation :
       {RotationTest::elements, RotationTest::magnitude, RotationTest::view}) {
    for (int trial = 0; trial < 100; ++trial) {
      const DistanceTest test(group, {.translation = {99.0, 99.0, 99.0},
                                      .rotation = kPi,
                                      .probability = 0.9,
                                      .test = rotation});
      const Displacement d = displacement(world.random(draw, 1.0, 1.8),
                                          group.isotropic(1e-3, draw.uniform(0.01, 30.0)));
      EXPECT_TRUE(test.passes(test.dimensions(d))) << static_cast<int>(rotation);
    }
  }
}

}  // namespace
}  // namespace cairn::compact
