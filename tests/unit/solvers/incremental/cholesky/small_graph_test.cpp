// SPDX-License-Identifier: BSD-3-Clause
#include "small_graph.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <tuple>

namespace cairn::incremental {
namespace {

/// Minimum degree as the books have it.
std::vector<std::int32_t> order_naively(std::vector<std::set<int>> neighbours,
                                        const std::vector<std::uint8_t>& group) {
  const int n = static_cast<int>(neighbours.size());
  std::vector<std::int32_t> order;
  std::vector<bool> gone(n, false);
  for (int k = 0; k < n; ++k) {
    int best = -1;
    const auto key = [&](int v) { return std::tuple(group[v], neighbours[v].size(), v); };
    for (int v = 0; v < n; ++v) {
      if (!gone[v] && (best < 0 || key(v) < key(best))) best = v;
    }
    order.push_back(best);
    gone[best] = true;
    for (const int a : neighbours[best]) {
      neighbours[a].erase(best);
      for (const int b : neighbours[best]) {
        if (a != b) neighbours[a].insert(b);
      }
    }
  }
  return order;
}

TEST(SmallGraph, EliminatesTheNodeOfLeastDegreeOfTheFirstGroup) {
  SmallGraph graph;  // one for all, so that what is left of the last one would show
  for (unsigned seed = 1; seed <= 60; ++seed) {
    std::mt19937 rng(seed);
    const int n = static_cast<int>(rng() % 150);
    std::vector<std::set<int>> neighbours(n);
    graph.reset(n);
    ASSERT_EQ(graph.nodes(), n);
    const auto join = [&](int a, int b) {
      if (a == b) return;
      neighbours[a].insert(b);
      neighbours[b].insert(a);
    };
    for (int k = 1; k < n + static_cast<int>(rng() % 40); ++k) {
      if (n < 2) break;
      const int a = static_cast<int>(rng() % n), b = k < n ? k - 1 : static_cast<int>(rng() % n);
      if (a == b) continue;
      join(a, b);
      graph.join(a, b);
    }
    for (int k = 0; n > 0 && k < static_cast<int>(rng() % 6); ++k) {
      std::set<std::int32_t> members;
      for (int m = 0; m < 6; ++m) members.insert(static_cast<std::int32_t>(rng() % n));
      const std::vector<std::int32_t> clique(members.begin(), members.end());
      graph.join_all(clique);
      for (const int a : clique) {
        for (const int b : clique) join(a, b);
      }
    }
    std::vector<std::uint8_t> group(n);
    const unsigned groups = 1 + rng() % 3;
    for (std::uint8_t& g : group) g = static_cast<std::uint8_t>(rng() % groups);
    std::vector<std::int32_t> order = {7, 7};
    graph.order(group, order);
    ASSERT_EQ(order, order_naively(neighbours, group)) << "seed " << seed;
  }
}

TEST(SmallGraph, DecidesATieForTheLowerNumber) {
  SmallGraph graph;
  graph.reset(70);
  std::vector<std::int32_t> order;
  graph.order(std::vector<std::uint8_t>(70), order);
  for (int k = 0; k < 70; ++k) EXPECT_EQ(order[k], k);
}

}  // namespace
}  // namespace cairn::incremental
