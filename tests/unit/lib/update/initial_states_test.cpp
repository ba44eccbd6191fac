// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/initial_states.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "cairn/types/loss.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;

using State = std::vector<double>;

/// ρ(s) = min(s, 1).
class Truncated final : public Loss {
 public:
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < rho.size(); ++k) rho[k] = std::min(s[k], 1.0);
    for (std::size_t k = 0; k < weight.size(); ++k) weight[k] = s[k] < 1.0 ? 1.0 : 0.0;
  }
  double second_derivative(double /*s*/) const override { return 0.0; }
};

/// What is known are poses 0 at (0, 0, 0) and 1 at (10, 0, 0).
class InitialStatesTest : public ::testing::Test {
 protected:
  Variable pose(Id id, State x) const { return {types_.pose, id, std::move(x), false}; }
  Factor between(Id a, Id b, State z, double information = 1.0) const {
    return {types_.relative_pose,
            {a, b},
            std::move(z),
            {information, 0, 0, information, 0, information}};
  }
  int replace(GraphUpdate& update, Deciding deciding = Deciding::all) {
    return replace_poor_states(
        update,
        [&](Id id) {
          const auto it = known_.find(id);
          return it == known_.end() ? std::span<const double>() : it->second;
        },
        deciding);
  }
  static auto at(double x, double y, double theta) {
    return ElementsAre(DoubleNear(x, 1e-12), DoubleNear(y, 1e-12), DoubleNear(theta, 1e-12));
  }

  test::PlanarTypes types_;
  std::map<Id, State> known_ = {{0, {0, 0, 0}}, {1, {10, 0, 0}}};
};

TEST_F(InitialStatesTest, AStateOfAnotherEstimateGivesWayToTheMeasurement) {
  GraphUpdate update;
  update.variables = {pose(2, {-7, 3, 2})};
  update.factors = {between(1, 2, {1, 0, 0.5})};
  EXPECT_EQ(replace(update), 1);
  EXPECT_THAT(update.variables[0].state, at(11, 0, 0.5));
}

TEST_F(InitialStatesTest, AComponentWithoutInformationReplacesNoState) {
  GraphUpdate update;
  update.variables = {pose(2, {-7, 3, 2})};
  update.factors = {between(1, 2, {1, 0, 0.5})};
  update.factors[0].information = {1, 0, 0, 1, 0, 0};
  EXPECT_EQ(replace(update), 0);
  EXPECT_THAT(update.variables[0].state, at(-7, 3, 2));
}

TEST_F(InitialStatesTest, AStateStaysThatOneMeasurementDoesNotContradict) {
  for (const double x : {11.0, 11.0 + 2.9, 11.0 + 3.1, 10.0 - 2.9, 10.0 - 3.1}) {
    GraphUpdate update;  // where either puts it, the other leaves a chi2 of 1
    update.variables = {pose(2, {x, 0, 0})};
    update.factors = {between(1, 2, {1, 0, 0}), between(0, 2, {10, 0, 0})};
    const double off = std::min(std::abs(x - 11.0), std::abs(x - 10.0));
    EXPECT_EQ(replace(update), off > 3.0 ? 1 : 0) << x;
  }
}

TEST_F(InitialStatesTest, WhatWasComposedWithOdometryStaysWhateverALoopClosureSays) {
  GraphUpdate update;
  update.variables = {pose(2, {11, 0, 0})};
  update.factors = {between(1, 2, {1, 0, 0}), between(0, 2, {9, 2, 0}, 1e6)};
  EXPECT_EQ(replace(update), 0);
}

TEST_F(InitialStatesTest, OfSeveralPlacesItGetsTheOneWithTheLeastChi2) {
  for (const double certain : {0.1, 100.0}) {
    GraphUpdate update;
    update.variables = {pose(2, {50, 0, 0})};
    update.factors = {between(1, 2, {1, 0, 0}), between(0, 2, {10, 0, 0}, certain),
                      between(0, 2, {10.01, 0, 0}, certain)};
    EXPECT_EQ(replace(update), 1);
    // chi2 at 11, at 10 and at 10.01.
    const auto chi2 = [&](double x) {
      return std::pow(x - 11, 2) + certain * (std::pow(x - 10, 2) + std::pow(x - 10.01, 2));
    };
    double best = 11;
    for (const double x : {10.0, 10.01})
      if (chi2(x) < chi2(best)) best = x;
    EXPECT_THAT(update.variables[0].state, at(best, 0, 0)) << certain;
  }
}

TEST_F(InitialStatesTest, WhatFollowsOnWhatIsNewMovesWithIt) {
  GraphUpdate update;  // listed from the end, as a file might
  update.variables = {pose(4, {3, 0, 0}), pose(3, {2, 0, 0}), pose(2, {1, 0, 0})};
  update.factors = {between(3, 4, {1, 0, 0}), between(2, 3, {1, 0, 0}),
                    between(1, 2, {1, 0, M_PI / 2})};
  EXPECT_EQ(replace(update), 3);
  EXPECT_THAT(update.variables[2].state, at(11, 0, M_PI / 2));
  EXPECT_THAT(update.variables[1].state, at(11, 1, M_PI / 2));
  EXPECT_THAT(update.variables[0].state, at(11, 2, M_PI / 2));
}

// As where a part of a map is added anew, and a loop closure at its end with it.
TEST_F(InitialStatesTest, AChainThatAgreesWithOdometryStaysThoughALoopClosureAtItsEndDoesNot) {
  GraphUpdate update;
  update.factors.push_back(between(0, 6, {5, 5, 0}, 1e4));
  for (Id k = 2; k < 7; ++k) {
    update.variables.push_back(pose(k, {9.0 + static_cast<double>(k), 0, 0}));
    update.factors.push_back(between(k - 1, k, {1, 0, 0}));
  }
  EXPECT_EQ(replace(update), 0);
  std::ranges::reverse(update.variables);
  EXPECT_EQ(replace(update), 0);
}

TEST_F(InitialStatesTest, WhatIsFixedOrNotJoinedWithWhatIsKnownStays) {
  GraphUpdate update;
  update.variables = {pose(2, {-7, 3, 2}), pose(3, {5, 5, 0}), pose(4, {9, 9, 0}),
                      pose(5, {8, 8, 0})};
  update.variables[0].fixed = true;
  update.factors = {between(1, 2, {1, 0, 0}),
                    between(4, 5, {1, 0, 0}),
                    {types_.prior, {3}, {0, 0, 0}, {1, 0, 0, 1, 0, 1}}};
  EXPECT_EQ(replace(update), 0);
  EXPECT_THAT(update.variables[0].state, at(-7, 3, 2));
  EXPECT_THAT(update.variables[1].state, at(5, 5, 0));
  EXPECT_THAT(update.variables[2].state, at(9, 9, 0));
  EXPECT_THAT(update.variables[3].state, at(8, 8, 0));
}

TEST_F(InitialStatesTest, AnOutlierDoesNotDecideWhereLossesAreKnownOrToCome) {
  GraphUpdate update;  // a false loop closure, ten times as certain as odometry
  update.variables = {pose(2, {-900, 3, 2})};
  update.factors = {between(1, 2, {1, 0, 0}), between(0, 2, {-30, 0, 0}, 10.0)};
  GraphUpdate without = update, first = update, with = update;
  EXPECT_EQ(replace(without), 1);
  EXPECT_THAT(without.variables[0].state, at(-30, 0, 0));
  EXPECT_EQ(replace(first, Deciding::first), 1);
  EXPECT_THAT(first.variables[0].state, at(11, 0, 0));
  with.factors[1].loss = std::make_shared<Truncated>();
  EXPECT_EQ(replace(with), 1);
  EXPECT_THAT(with.variables[0].state, at(11, 0, 0));
}

TEST_F(InitialStatesTest, AStateThatNoMeasurementDeterminesStays) {
  GraphUpdate update;
  update.variables = {{types_.pose, 2, {1, 2, 3}, false}};
  update.factors = {{types_.point_seen, {2, 9}, {1, 1}, {1, 0, 1}}};
  known_[9] = {4, 4};
  EXPECT_EQ(replace(update), 0);
  EXPECT_THAT(update.variables[0].state, at(1, 2, 3));
}

}  // namespace
}  // namespace cairn
