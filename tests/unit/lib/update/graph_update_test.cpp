// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/graph_update.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "cairn/runtime/error.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::vector<double> kUnit = {1, 0, 0, 1, 0, 1};

class GraphUpdateTest : public ::testing::Test {
 protected:
  Variable pose(Id id, std::vector<double> x = {}) const { return {types_.pose, id, x, false}; }
  Factor between(Id a, Id b) const {
    return {types_.relative_pose, {a, b}, {1.0, 0.0, 0.5}, kUnit};
  }
  AppliedUpdate apply(GraphUpdate update) {
    check_update(graph_, ids_, update);
    return apply_update(update, graph_, ids_);
  }
  std::string refusal(GraphUpdate update) {
    try {
      check_update(graph_, ids_, update);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::input);
      return error.what();
    }
    return "";
  }
  /// Poses 0, 1, 2 in a chain.
  void begin() {
    GraphUpdate update;
    update.variables = {pose(0, {0, 0, 0}), pose(1), pose(2)};
    update.factors = {between(0, 1), between(1, 2)};
    apply(update);
  }
  test::PlanarTypes types_;
  Graph graph_;
  FactorIds ids_;
};

TEST_F(GraphUpdateTest, PlacesWhatIsNewWhateverTheOrder) {
  GraphUpdate update;
  update.variables = {pose(2), pose(1), pose(0, {0, 0, 4 * M_PI})};
  update.factors = {between(1, 2), between(0, 1)};
  check_update(graph_, ids_, update);
  EXPECT_NEAR(update.variables[1].state[0], 1.0, 1e-12);
  EXPECT_NEAR(update.variables[0].state[2], 1.0, 1e-12);
  EXPECT_NEAR(update.variables[2].state[2], 0.0, 1e-12);  // normalized
  EXPECT_EQ(graph_.variable_count(), 0);
}

TEST_F(GraphUpdateTest, PlacesByAComponentWithoutInformationNothing) {
  GraphUpdate update;
  update.variables = {pose(0, {2, 3, 0.5}), pose(1), pose(2)};
  update.factors = {between(0, 1), between(1, 2), between(0, 2)};
  update.factors[0].measurement = {77, 0.25, 0};  // nothing of how far ahead
  update.factors[0].information = {0, 0, 0, 1, 0, 1};
  update.factors[2].information = {1, 0, 0, 1, 0, 0};  // without the heading
  check_update(graph_, ids_, update);
  // Beside pose 0 but for what is measured.
  const std::vector<double>& placed = update.variables[1].state;
  EXPECT_NEAR(placed[0], 2 - 0.25 * std::sin(0.5), 1e-12);
  EXPECT_NEAR(placed[1], 3 + 0.25 * std::cos(0.5), 1e-12);
  EXPECT_NEAR(placed[2], 0.5, 1e-12);
}

TEST_F(GraphUpdateTest, TellsWhatItCannotPlace) {
  GraphUpdate update;
  update.variables = {pose(0), pose(1)};
  update.factors = {between(0, 1)};
  EXPECT_THAT(place_variables(update, [](Id) { return std::span<const double>(); }),
              ElementsAre(0, 1));
  EXPECT_THAT(refusal(update), HasSubstr("VERTEX_SE2 0: has no state"));
}

TEST_F(GraphUpdateTest, IdsOfFactorsAreNeverUsedTwice) {
  begin();
  GraphUpdate update;
  update.removed_factors = {1};
  update.factors = {between(0, 2)};
  EXPECT_EQ(apply(update).first_factor, 2);
  EXPECT_EQ(ids_.position(0), 0);
  EXPECT_EQ(ids_.position(1), std::nullopt);
  EXPECT_EQ(ids_.position(2), 1);
  EXPECT_EQ(ids_.id(1), 2);
  EXPECT_EQ(ids_.next(), 3);
}

TEST_F(GraphUpdateTest, AVariableLeavesWithItsFactors) {
  begin();
  GraphUpdate update;
  update.removed_variables = {1};
  apply(update);
  EXPECT_EQ(graph_.variable_count(), 2);
  EXPECT_EQ(graph_.factor_count(), 0);
}

TEST_F(GraphUpdateTest, MarginalizationLeavesPriorsWithIdsOfTheirOwn) {
  begin();
  GraphUpdate update;
  update.factors = {between(0, 2)};
  update.marginalized = {1};
  const AppliedUpdate applied = apply(update);
  EXPECT_EQ(applied.first_factor, 2);
  EXPECT_THAT(applied.priors, ElementsAre(3));
  EXPECT_EQ(graph_.describe_factor(*ids_.position(3)), "MARGINAL_PRIOR 0 2");
  EXPECT_EQ(graph_.factor_count(), 2);

  update = {};
  update.changed = {{3, {}, {}}};
  EXPECT_THAT(refusal(update), HasSubstr("cannot be changed, only removed"));
  update = {};
  update.removed_factors = {3};
  apply(update);
  EXPECT_EQ(graph_.factor_count(), 1);
}

TEST_F(GraphUpdateTest, WhatIsNewMayChangeAndLeaveAtOnce) {
  begin();
  GraphUpdate update;
  update.variables = {pose(3), pose(4)};
  update.factors = {between(2, 3), between(3, 4)};
  update.changed = {{2, {2.0, 0.0, 0.0}, {}}};
  update.marginalized = {3};
  update.removed_factors = {0};
  apply(update);
  EXPECT_EQ(graph_.find(3), std::nullopt);
  EXPECT_TRUE(graph_.find(4));
  EXPECT_EQ(ids_.position(0), std::nullopt);
}

TEST_F(GraphUpdateTest, RefusesWhatIsWrongAndChangesNothing) {
  begin();
  const auto version = graph_.structure_version();
  const auto refused = [&](auto&& fill) {
    GraphUpdate update;
    fill(update);
    return refusal(update);
  };
  using U = GraphUpdate&;
  EXPECT_THAT(refused([&](U u) { u.variables = {pose(1)}; }),
              HasSubstr("VERTEX_SE2 1: the id is already that of VERTEX_SE2 1"));
  EXPECT_THAT(refused([&](U u) {
                u.variables = {pose(5, {0, 0, 0}), pose(5, {0, 0, 0})};
              }),
              HasSubstr("VERTEX_SE2 5: the id is already"));
  EXPECT_THAT(refused([&](U u) { u.variables = {pose(5, {0, NAN, 0})}; }), HasSubstr("not finite"));
  EXPECT_THAT(refused([&](U u) {
                u.variables = {{nullptr, 5, {}, false}};
              }),
              HasSubstr("variable 5 has no type"));
  EXPECT_THAT(refused([&](U u) {
                u.variables = {{test::PlanarTypes().pose, 5, {0, 0, 0}, false}};
              }),
              HasSubstr("another type of that name"));
  EXPECT_THAT(refused([&](U u) { u.factors = {between(1, 8)}; }),
              HasSubstr("EDGE_SE2 1 8: there is no variable 8"));
  EXPECT_THAT(refused([&](U u) { u.factors = {between(1, 1)}; }), HasSubstr("with itself"));
  EXPECT_THAT(refused([&](U u) {
                u.factors = {between(0, 1)};
                u.factors[0].information[5] = -1;
              }),
              HasSubstr("not positive semidefinite"));
  EXPECT_THAT(refused([&](U u) { u.factors = {Factor{}}; }), HasSubstr("has no type"));
  EXPECT_THAT(refused([&](U u) {
                u.changed = {{9, {0, 0, 0}, {}}};
              }),
              HasSubstr("there is no factor 9 to be changed"));
  EXPECT_THAT(refused([&](U u) {
                u.changed = {{0, {0, 0}, {}}};
              }),
              HasSubstr("EDGE_SE2 0 1: 2 + 6 numbers"));
  EXPECT_THAT(refused([&](U u) { u.removed_factors = {0, 0}; }), HasSubstr("removed twice"));
  EXPECT_THAT(refused([&](U u) { u.removed_variables = {7}; }),
              HasSubstr("there is no variable 7 to be removed"));
  EXPECT_THAT(refused([&](U u) {
                u.removed_variables = {1};
                u.marginalized = {1};
              }),
              HasSubstr("to leave twice"));
  EXPECT_THAT(refused([&](U u) {
                u.removed_factors = {1};
                u.marginalized = {2};
              }),
              HasSubstr("variable 2 is marginalized in the same update"));
  EXPECT_EQ(graph_.structure_version(), version);
}

}  // namespace
}  // namespace cairn
