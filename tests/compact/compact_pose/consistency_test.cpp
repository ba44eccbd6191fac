// SPDX-License-Identifier: BSD-3-Clause
#include "consistency.hpp"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::Draw;
using test::numerical_jacobian;
using test::PoseWorld;
using test::types_of;
using Pose = PoseWorld::Pose;
constexpr double kPi = std::numbers::pi;

class ConsistencyIn : public testing::TestWithParam<int> {
 protected:
  SensorRange range{.translation = {2.0, 3.0, 1.5}, .rotation = kPi};

  ConsistencyCheck check(double gate, double trust = 0.01) const {
    return {group, range, {gate}, trust};
  }
  Displacement displacement(const Pose& mean, const MatrixXd& covariance) const {
    Displacement d = group.displacement(group.place(group.state(world.identity())),
                                        group.place(group.state(mean)));
    d.covariance = covariance;
    return d;
  }
  Link link(const Pose& mean, const MatrixXd& covariance) const {
    Link link;
    link.mean = group.state(mean);
    link.covariance = covariance;
    return link;
  }
  Pose noisy(const Pose& x, const MatrixXd& Sigma, Draw& draw) const {
    return world.moved(x, draw.error(Sigma));
  }
  /// Within five standard deviations of what is expected.
  static void expect_share(int count, int trials, double probability) {
    EXPECT_NEAR(count, trials * probability,
                5.0 * std::sqrt(trials * probability * (1.0 - probability)));
  }

  Registry registry;
  PoseWorld world{types_of(GetParam(), registry)};
  RigidGroup group{world.types().pose};
  int n = world.tangent();
};
INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, ConsistencyIn, testing::Values(2, 3));

TEST_P(ConsistencyIn, RightLinksPassTheGateAsOftenAsChosen) {
  Draw draw(1);
  for (const double gate : {0.5, 0.9, 0.99}) {
    const ConsistencyCheck gated = check(gate);
    constexpr int kTrials = 4000;
    int passed = 0;
    double sum = 0.0;
    for (int trial = 0; trial < kTrials; ++trial) {
      const MatrixXd S_d = draw.covariance(n, 0.02), S_y = draw.covariance(n, 0.01);
      const Pose truth = world.random(draw, 3.0, 1.5);
      const Fit fit =
          gated.fit(link(noisy(truth, S_y, draw), S_y), displacement(noisy(truth, S_d, draw), S_d));
      passed += fit.consistent;
      sum += fit.innovation;
      EXPECT_FALSE(gated.needs_another(fit));
    }
    expect_share(passed, kTrials, gate);
    EXPECT_NEAR(sum / kTrials, n, 5.0 * std::sqrt(2.0 * n / kTrials));
  }
}

TEST_P(ConsistencyIn, FalseLinksDoNotPassWhereTheDisplacementIsKnown) {
  Draw draw(2);
  const ConsistencyCheck gated = check(0.99);
  for (int trial = 0; trial < 2000; ++trial) {
    const MatrixXd S_d = draw.covariance(n, 0.01), S_y = draw.covariance(n, 0.01);
    const Fit fit = gated.fit(link(world.random(draw, 3.0, 1.5), S_y),
                              displacement(world.random(draw, 3.0, 1.5), S_d));
    EXPECT_FALSE(fit.consistent);
  }
}

// The part of the sensor's range that lies within the gate.
TEST_P(ConsistencyIn, TheChanceIsHowOftenAFalseMatchFits) {
  Draw draw(3);
  const ConsistencyCheck gated = check(0.8);
  for (int trial = 0; trial < 3; ++trial) {
    const MatrixXd S_d = draw.covariance(n, 0.4), S_y = draw.covariance(n, 0.3);
    const Pose expected = world.random(draw, 3.0, 1.5);
    constexpr int kTrials = 40'000;
    int passed = 0;
    double chance = 0.0;
    for (int k = 0; k < kTrials; ++k) {
      VectorXd e(n);
      for (int r = 0; r < n; ++r) {
        const double v = r < GetParam() ? range.translation[r] : kPi;
        e[r] = draw.uniform(-v, v);
      }
      // Where e is no rotation vector any more, the same rotation has another: leave that out.
      if (e.tail(n - GetParam()).norm() > kPi) continue;
      const Fit fit = gated.fit(link(world.moved(expected, e), S_y), displacement(expected, S_d));
      passed += fit.consistent;
      chance = fit.chance;
    }
    ASSERT_LT(chance, 0.5);
    expect_share(passed, kTrials, chance);
    EXPECT_TRUE(check(0.8, 0.99 * chance).needs_another({.chance = chance}));
    EXPECT_FALSE(check(0.8, 1.01 * chance).needs_another({.chance = chance}));
  }
}

TEST_P(ConsistencyIn, AChanceIsNoMoreThanCertainty) {
  const Fit fit = check(0.99).fit(link(world.identity(), 1e4 * MatrixXd::Identity(n, n)),
                                  displacement(world.identity(), 1e4 * MatrixXd::Identity(n, n)));
  EXPECT_EQ(fit.chance, 1.0);
}

TEST_P(ConsistencyIn, WithoutAGateEverythingIsConsistent) {
  Draw draw(4);
  const ConsistencyCheck open = check(0.0);
  EXPECT_FALSE(open.on());
  const MatrixXd S = draw.covariance(n, 0.01);
  const Fit fit = open.fit(link(world.random(draw, 3.0, 1.5), S),
                           displacement(world.random(draw, 3.0, 1.5), 1e4 * S));
  EXPECT_TRUE(fit.consistent);
  EXPECT_GT(fit.innovation, 0.0);
  EXPECT_FALSE(open.needs_another(fit));
  EXPECT_FALSE(open.needs_another({.chance = 1.0}));
}

/// Two links between two stretches of the way, and what is between their ends.
struct Cycle {
  Pose z_a, z_b, u, w;
  MatrixXd S_a, S_b, S_u, S_w;
};

class TwoLinks : public ConsistencyIn {
 protected:
  Cycle draw_cycle(Draw& draw) const {
    Cycle c{world.random(draw, 3.0, 1.5),
            {},
            world.random(draw, 2.0, 1.0),
            world.random(draw, 2.0, 1.0),
            {},
            {},
            {},
            {}};
    c.S_a = draw.covariance(n, 0.01), c.S_b = draw.covariance(n, 0.02);
    c.S_u = draw.covariance(n, 0.015), c.S_w = draw.covariance(n, 0.005);
    c.z_b = world.compose(world.inverse(c.u), world.compose(c.z_a, c.w));
    return c;
  }
  Cycle measured(const Cycle& truth, Draw& draw) const {
    Cycle c = truth;
    c.z_a = noisy(c.z_a, c.S_a, draw);
    c.z_b = noisy(c.z_b, c.S_b, draw);
    c.u = noisy(c.u, c.S_u, draw);
    c.w = noisy(c.w, c.S_w, draw);
    return c;
  }
  Fit agreement(const ConsistencyCheck& gated, const Cycle& c) const {
    return gated.agreement(link(c.z_a, c.S_a), link(c.z_b, c.S_b), displacement(c.u, c.S_u),
                           displacement(c.w, c.S_w));
  }
  /// x_i z_a w = x_i u z_b
  Pose around(const Cycle& c) const {
    return world.compose(world.inverse(world.compose(c.u, c.z_b)), world.compose(c.z_a, c.w));
  }
};
INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, TwoLinks, testing::Values(2, 3));

TEST_P(TwoLinks, CloseACycleWithItsOwnCovariance) {
  Draw draw(5);
  const ConsistencyCheck gated = check(0.9);
  for (int trial = 0; trial < 50; ++trial) {
    const Cycle c = measured(draw_cycle(draw), draw);
    const Pose cycle = around(c);
    const MatrixXd J = numerical_jacobian(4 * n, [&](const VectorXd& step) {
      Cycle moved = c;
      moved.z_a = world.moved(c.z_a, step.segment(0, n));
      moved.z_b = world.moved(c.z_b, step.segment(n, n));
      moved.u = world.moved(c.u, step.segment(2 * n, n));
      moved.w = world.moved(c.w, step.segment(3 * n, n));
      return world.log(world.between(cycle, around(moved)));
    });
    MatrixXd joint = MatrixXd::Zero(4 * n, 4 * n);
    const MatrixXd* blocks[] = {&c.S_a, &c.S_b, &c.S_u, &c.S_w};
    for (int k = 0; k < 4; ++k) joint.block(k * n, k * n, n, n) = *blocks[k];
    const MatrixXd S = J * joint * J.transpose();
    const VectorXd e = world.log(cycle);
    const Fit fit = agreement(gated, c);
    EXPECT_NEAR(fit.innovation, e.dot(S.llt().solve(e)), 1e-6 * (1.0 + fit.innovation));
    const Fit single =
        gated.fit(link(world.identity(), S), displacement(world.identity(), MatrixXd::Zero(n, n)));
    EXPECT_NEAR(fit.chance / single.chance, 1.0, 1e-6);
  }
}

TEST_P(TwoLinks, AgreeAsOftenAsChosen) {
  Draw draw(6);
  const ConsistencyCheck gated = check(0.9);
  constexpr int kTrials = 4000;
  int passed = 0;
  for (int trial = 0; trial < kTrials; ++trial)
    passed += agreement(gated, measured(draw_cycle(draw), draw)).consistent;
  expect_share(passed, kTrials, 0.9);
}

TEST_P(TwoLinks, DisagreeIfOneOfThemIsFalse) {
  Draw draw(7);
  const ConsistencyCheck gated = check(0.999);
  for (int trial = 0; trial < 500; ++trial) {
    Cycle c = measured(draw_cycle(draw), draw);
    (trial % 2 == 0 ? c.z_a : c.z_b) = world.random(draw, 3.0, 1.5);
    EXPECT_FALSE(agreement(gated, c).consistent);
  }
}

}  // namespace
}  // namespace cairn::compact
