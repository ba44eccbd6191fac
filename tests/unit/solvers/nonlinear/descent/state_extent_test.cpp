// SPDX-License-Identifier: BSD-3-Clause
#include "state_extent.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "support/sample_graphs.hpp"

namespace cairn::test {
namespace {

/// Rings with their first pose at these places.
Graph rings(const std::vector<double>& places) {
  const Graph ring = ring_of_poses(30, 0.01);
  Graph graph;
  for (const double place : places) {
    const int first = graph.variable_count();
    for (int v = 0; v < ring.variable_count(); ++v) {
      std::vector<double> x(ring.state(v).begin(), ring.state(v).end());
      x[0] += place;
      graph.add_variable(ring.variable_pools()[0].type, graph.variable_count(), x);
    }
    for (int f = 0; f < ring.factor_count(); ++f) {
      std::vector<int> variables;
      for (const int v : ring.factor_variables(f)) variables.push_back(first + v);
      graph.add_factor(ring.factor_pools()[0].type, variables, ring.measurement(f),
                       ring.information(f));
    }
  }
  return graph;
}

double extent(const Graph& graph) {
  return state_extent(graph, resolve_gauge(graph), graph.values());
}

TEST(StateExtent, IsThatOfTheMapWhereverItIs) {
  const double at_home = extent(rings({0.0}));
  EXPECT_NEAR(at_home, std::sqrt(30.0) * 5.0, 10.0);  // headings beside the radius of 5 m
  EXPECT_NEAR(extent(rings({1e6})), at_home, 1e-6 * at_home);
}

TEST(StateExtent, DoesNotSpanTheGapsBetweenMaps) {
  const double one = extent(rings({0.0}));
  EXPECT_NEAR(extent(rings({0.0, 1e6})), std::sqrt(2.0) * one, 1e-6 * one);
  EXPECT_NEAR(extent(rings({-1e5, 1e6, 3e6})), std::sqrt(3.0) * one, 1e-6 * one);
}

TEST(StateExtent, IsAtLeastWhatRoundingLeavesOfTheStates) {
  EXPECT_NEAR(extent(rings({1e12})), 1e-6 * std::sqrt(30.0) * 1e12, 1e3);
}

}  // namespace
}  // namespace cairn::test
