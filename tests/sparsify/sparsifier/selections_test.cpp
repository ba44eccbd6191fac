// SPDX-License-Identifier: BSD-3-Clause
#include "selections.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "sparsify/sparsifier/blankets.hpp"

namespace cairn::sparsify {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::Gt;
using testing::IsEmpty;
using testing::Not;
using testing::UnorderedElementsAre;

/// Does nothing; must not be asked.
class Nobody : public Sparsifier {
 public:
  Sparsification remove(const Graph&, std::span<const int>,
                        const std::function<bool(int)>&) override {
    ADD_FAILURE();
    return {};
  }
  void observe(SparsificationObserver) override {}
  std::vector<double> losses(const Graph&, std::span<const int>) override {
    ADD_FAILURE();
    return {};
  }
};

/// Each node costs what the test says; what leaves is replaced by nothing.
class Priced final : public Nobody {
 public:
  explicit Priced(std::map<Id, double> prices) : prices_(std::move(prices)) {}
  Sparsification remove(const Graph& graph, std::span<const int> nodes,
                        const std::function<bool(int)>&) override {
    Sparsification change;
    change.removed_variables.assign(nodes.begin(), nodes.end());
    for (int f = 0; f < graph.factor_count(); ++f) {
      for (const int v : graph.factor_variables(f)) {
        if (std::ranges::find(nodes, v) == nodes.end()) continue;
        change.removed_factors.push_back(f);
        break;
      }
    }
    return change;
  }
  std::vector<double> losses(const Graph& graph, std::span<const int> nodes) override {
    std::vector<double> all;
    for (const int v : nodes) all.push_back(prices_.at(graph.id(v)));
    return all;
  }

 private:
  std::map<Id, double> prices_;
};

class Selections : public testing::Test {
 protected:
  static std::vector<int> all(const Graph& graph) {
    std::vector<int> nodes(graph.variable_count());
    std::iota(nodes.begin(), nodes.end(), 0);
    return nodes;
  }
  /// Poses 0 … n − 1, at places that mean nothing, related by the pairs.
  Graph graph_of(int n, const std::vector<std::array<int, 2>>& pairs) {
    const auto pose = registry.variable_type("VERTEX_SE2");
    const auto edge = registry.factor_type("EDGE_SE2");
    Graph graph;
    for (int v = 0; v < n; ++v) graph.add_variable(pose, v, std::array{1.0 * v, 0.0, 0.0});
    for (const std::array<int, 2>& pair : pairs) {
      graph.add_factor(edge, pair, std::array{1.0 * (pair[1] - pair[0]), 0.0, 0.0},
                       pack(Matrix::Identity(3, 3)));
    }
    return graph;
  }
  Graph chain(int n) {
    std::vector<std::array<int, 2>> pairs;
    for (int v = 1; v < n; ++v) pairs.push_back({v - 1, v});
    return graph_of(n, pairs);
  }
  Registry registry;
  Nobody nobody;
};

/// The counts of the thesis's tables (T 4.6.4).
TEST_F(Selections, KeepEveryKeepsAsManyAsTheThesis) {
  const std::map<int, std::array<std::size_t, 4>> leave{{3500, {2332, 2624, 2799, 3149}},
                                                        {1228, {818, 920, 981, 1104}},
                                                        {989, {658, 741, 790, 889}},
                                                        {808, {538, 605, 645, 726}}};
  constexpr std::array<int, 4> kEvery{3, 4, 5, 10};
  for (const auto& [poses, expected] : leave) {
    const Graph graph = simulate(registry, "manhattan:poses=" + std::to_string(poses));
    ASSERT_EQ(graph.variable_count(), poses);
    const std::vector<int> nodes = all(graph);
    for (std::size_t k = 0; k < kEvery.size(); ++k) {
      const std::vector<int> chosen = KeepEvery(kEvery[k]).select(graph, nodes, nobody);
      EXPECT_EQ(chosen.size(), expected[k]) << poses << " poses, every " << kEvery[k];
      EXPECT_TRUE(std::ranges::is_sorted(chosen));
      for (const int v : chosen) EXPECT_NE(v % kEvery[k], 0);
    }
  }
}

TEST_F(Selections, KeepEveryCountsOnFromCallToCall) {
  const Graph graph = chain(10);
  EXPECT_THAT(KeepEvery(3).select(graph, all(graph), nobody), ElementsAre(1, 2, 4, 5, 7, 8));
  EXPECT_THAT(KeepEvery(1).select(graph, all(graph), nobody), IsEmpty());
  KeepEvery every(3);
  EXPECT_THAT(every.select(graph, std::vector{0, 1, 2, 3, 4}, nobody), ElementsAre(1, 2, 4));
  EXPECT_THAT(every.select(graph, std::vector{5, 6, 7}, nobody), ElementsAre(5, 7));
  // The graph's last stays.
  EXPECT_THAT(every.select(graph, std::vector{8, 9}, nobody), ElementsAre(8));
}

TEST_F(Selections, OldestLeaveFirst) {
  const Graph graph = chain(10);
  EXPECT_THAT(Oldest(0.3).select(graph, all(graph), nobody), ElementsAre(0, 1, 2));
  EXPECT_THAT(Oldest(0.5).select(graph, std::vector{2, 3, 7, 9}, nobody), ElementsAre(2, 3));
  EXPECT_THAT(Oldest(0.0).select(graph, all(graph), nobody), IsEmpty());
  EXPECT_EQ(Oldest(1.0).select(graph, all(graph), nobody), all(graph));
}

/// Where each pose is and which way it looks, in the plane and in space.
double apart_in_place(const Graph& graph, int a, int b, double& angle) {
  const auto split = [&](int v) {
    const Placement& placement = *graph.type(v).placement();
    const int n = placement.dimension();
    std::pair<Matrix, Vector> at(Matrix::Zero(n, n), Vector::Zero(n));
    placement.split(graph.state(v).data(), at.first.data(), at.second.data());
    return at;
  };
  const auto [R, t] = split(a);
  const auto [Q, u] = split(b);
  // ‖R − Q‖ = 2 √2 sin(angle / 2), in the plane and in space.
  angle = 2.0 * std::asin(std::min(1.0, (R - Q).norm() / std::sqrt(8.0)));
  return (t - u).norm();
}

TEST_F(Selections, CoverageLeavesOneNearEveryNodeThatLeaves) {
  for (const std::string world :
       {"manhattan:poses=600,loop_density=0.5", "sphere:turns=10,poses_per_turn=30,radius=8"}) {
    const Graph graph = simulate(registry, world);
    for (const auto& [distance, angle] : {std::pair{1.2, 0.4}, {3.0, 3.15}, {2.5, 1.0}}) {
      const std::vector<int> chosen = Coverage(distance, angle).select(graph, all(graph), nobody);
      EXPECT_THAT(chosen.size(), Gt(10U)) << world;
      const std::set<int> leave(chosen.begin(), chosen.end());
      EXPECT_EQ(leave.size(), chosen.size());
      for (const int v : chosen) {
        bool covered = false;
        for (int other = 0; other < graph.variable_count() && !covered; ++other) {
          double turned = 0.0;
          if (leave.contains(other)) continue;
          covered =
              apart_in_place(graph, v, other, turned) < distance + 1e-9 && turned < angle + 1e-6;
        }
        EXPECT_TRUE(covered) << world << ", node " << v;
      }
    }
    EXPECT_THAT(Coverage(1e-9, 3.15).select(graph, all(graph), nobody), IsEmpty());
    EXPECT_THAT(Coverage(1e3, 0.0).select(graph, all(graph), nobody), IsEmpty());
    EXPECT_EQ(Coverage(1e6, 3.15).select(graph, all(graph), nobody).size() + 1,
              static_cast<std::size_t>(graph.variable_count()));
  }
}

TEST_F(Selections, CoverageLeavesWhatMayNotLeave) {
  const Graph graph = chain(6);
  // 0 stays though 1 is near, and covers it.
  EXPECT_THAT(Coverage(1.5, 1.0).select(graph, std::vector{1, 2, 4}, nobody), ElementsAre(1, 4));
}

TEST_F(Selections, SmallestBlanketTakesTheLeavesOfAStarFirst) {
  std::vector<std::array<int, 2>> rays;
  for (int v = 1; v < 8; ++v) rays.push_back({0, v});
  const Graph star = graph_of(8, rays);
  EXPECT_THAT(SmallestBlanket(0.75).select(star, all(star), nobody), Not(Contains(0)));
  const std::vector<int> everything = SmallestBlanket(1.0).select(star, all(star), nobody);
  EXPECT_EQ(std::set<int>(everything.begin(), everything.end()).size(), 8U);
  EXPECT_THAT(SmallestBlanket(0.5).select(star, std::vector{0, 5}, nobody), ElementsAre(5));
}

TEST_F(Selections, SmallestBlanketLooksAtWhatIsLeft) {
  // A chain that ends in a triangle: it unravels.
  const Graph graph = graph_of(7, {{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}, {5, 6}, {6, 4}});
  EXPECT_THAT(SmallestBlanket(4.0 / 7.0).select(graph, all(graph), nobody),
              UnorderedElementsAre(0, 1, 2, 3));
  // 0 leaves and joins 1 and 2, so 1 still has three neighbours; 6 has two, and leaves next.
  const Graph other =
      graph_of(7, {{0, 1}, {0, 2}, {1, 3}, {1, 4}, {2, 3}, {2, 5}, {3, 4}, {4, 6}, {5, 6}});
  EXPECT_THAT(SmallestBlanket(2.0 / 3.0).select(other, std::vector{0, 1, 6}, nobody),
              ElementsAre(0, 6));
}

TEST_F(Selections, SmallestBlanketThinsChainsOutEvenly) {
  constexpr int kNodes = 1000;
  const Graph graph = chain(kNodes);
  std::vector<int> inner = all(graph);
  inner.erase(inner.begin());
  inner.pop_back();
  for (const auto& [part, longest] : {std::pair{0.49, 1}, {0.74, 3}, {0.87, 7}}) {
    std::vector<bool> gone(kNodes);
    for (const int v : SmallestBlanket(part).select(graph, inner, nobody)) gone[v] = true;
    int gap = 0, widest = 0;
    for (const bool left : gone) widest = std::max(widest, gap = left ? gap + 1 : 0);
    EXPECT_LE(widest, longest) << part;
  }
  EXPECT_EQ(SmallestBlanket(1.0).select(graph, inner, nobody).size(), inner.size());
}

TEST_F(Selections, LeastLossTakesTheCheapestAndNothingThatCannotLeave) {
  const Graph graph = chain(24);
  const double never = std::numeric_limits<double>::infinity();
  std::map<Id, double> prices;
  for (int v = 0; v < 24; ++v) prices[v] = v % 3 == 0 ? never : 24.0 - v;
  for (const double part : {0.1, 0.4, 0.6, 1.0}) {
    Priced sparsifier(prices);
    const std::vector<int> chosen = LeastLoss(part).select(graph, all(graph), sparsifier);
    EXPECT_EQ(chosen.size(), std::min<std::size_t>(16, std::llround(24 * part)));
    EXPECT_EQ(std::set<int>(chosen.begin(), chosen.end()).size(), chosen.size());
    for (const int v : chosen) EXPECT_NE(v % 3, 0);
    ASSERT_FALSE(chosen.empty());
    EXPECT_EQ(chosen.front(), 23);
  }
  // Two of 24, in rounds of one.
  Priced sparsifier(prices);
  EXPECT_THAT(LeastLoss(2.0 / 24).select(graph, all(graph), sparsifier), ElementsAre(23, 22));
}

/// In one round no two of the same blanket leave, since each is priced while the others stay.
TEST_F(Selections, LeastLossTakesNoNeighboursInOneRound) {
  const Graph graph = chain(40);
  std::map<Id, double> prices;
  for (int v = 0; v < 40; ++v) prices[v] = v;
  Priced sparsifier(prices);
  const std::vector<int> chosen = LeastLoss(1.0).select(graph, all(graph), sparsifier);
  ASSERT_EQ(chosen.size(), 40U);
  EXPECT_THAT(std::vector<int>(chosen.begin(), chosen.begin() + 5), ElementsAre(0, 2, 4, 6, 8));
}

TEST_F(Selections, LeastLossNeverTakesWhatTheSparsifierCannot) {
  Graph graph = solved(registry, "manhattan:poses=80,loop_density=0.5");
  graph.set_fixed(17);
  graph.set_fixed(0);
  graph.set_fixed(33);
  const auto sparsifier = registry.make<Sparsifier>("sparsify");
  const std::vector<double> losses = sparsifier->losses(graph, all(graph));
  for (const int v : {0, 17, 33}) EXPECT_EQ(losses[v], std::numeric_limits<double>::infinity());
  const std::vector<int> chosen = LeastLoss(1.0).select(graph, all(graph), *sparsifier);
  EXPECT_THAT(chosen.size(), Gt(60U));
  for (const int v : {0, 17, 33}) EXPECT_THAT(chosen, Not(testing::Contains(v)));
}

TEST_F(Selections, OfTheTwoNearestTheOneThatCostsLessLeaves) {
  Graph graph = chain(6);
  for (int v = 0; v < 6; ++v) {
    constexpr std::array kPlaces{0.0, 1.0, 1.3, 3.0, 3.2, 9.0};
    graph.set_state(v, std::array{kPlaces[v], 0.0, 0.0});
  }
  Priced priced({{0, 1}, {1, 5}, {2, 6}, {3, 8}, {4, 7}, {5, 1}});
  // 3-4 are the nearest, then 1-2, then 0 and what is left of those.
  EXPECT_THAT(Nearest({}).choose(graph, all(graph), priced, 3), ElementsAre(4, 1, 0));
  // A node that must stay has neighbours all the same.
  EXPECT_THAT(Nearest({}).choose(graph, std::array{0, 3, 5}, priced, 2), ElementsAre(3, 0));
  EXPECT_THAT(Nearest({}).choose(graph, std::array{3}, nobody, 5), ElementsAre(3));
  EXPECT_THAT(Nearest({.part = 0.5}).select(graph, all(graph), priced), ElementsAre(4, 1, 0));
  // Orientation counts as far as it is asked for.
  graph.set_state(4, std::array{3.2, 0.0, 1.0});
  EXPECT_THAT(Nearest({.angle = 1.0}).choose(graph, all(graph), priced, 1), ElementsAre(1));
}

TEST_F(Selections, DistancesToNodesThatStayNeedNotCount) {
  Graph graph = chain(5);
  for (int v = 0; v < 5; ++v) {
    constexpr std::array kPlaces{0.0, 2.0, 5.0, 9.0, 10.0};
    graph.set_state(v, std::array{kPlaces[v], 0.0, 0.0});
  }
  Priced priced({{0, 5}, {1, 1}, {2, 9}, {3, 9}});
  const std::array open{0, 1, 2, 3};  // 4 is the newest
  EXPECT_THAT(Nearest({}).choose(graph, open, priced, 1), ElementsAre(3));
  EXPECT_THAT(Nearest({.leaving = true}).choose(graph, open, priced, 2), ElementsAre(1, 2));
  // Where there are no two such nodes, all count.
  EXPECT_THAT(Nearest({.leaving = true}).choose(graph, std::array{3}, nobody, 1), ElementsAre(3));
}

/// The search along x finds what comparing all pairs finds, ties included.
TEST_F(Selections, TheNearestAreThoseOfAllPairs) {
  const Graph graph = simulate(registry, "manhattan:poses=120,streets=3,noise=0");
  std::map<Id, double> prices;
  for (Id k = 0; k < 120; ++k) prices[k] = 0.0;
  Priced priced(prices);
  std::vector<int> left = all(graph), expected;
  while (expected.size() < 60) {
    double least = std::numeric_limits<double>::infinity();
    int leaves = -1;
    for (std::size_t a = 0; a < left.size(); ++a) {
      for (std::size_t b = 0; b < left.size(); ++b) {
        const auto x = graph.state(left[a]), y = graph.state(left[b]);
        const double there =
            std::sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]));
        if (a == b || there >= least) continue;
        least = there;
        leaves = std::min(left[a], left[b]);
      }
    }
    expected.push_back(leaves);
    std::erase(left, leaves);
  }
  EXPECT_EQ(Nearest({.neighbours = 1000}).choose(graph, all(graph), priced, 60), expected);
}

TEST_F(Selections, WhereManyLeaveTheSameOnesDo) {
  const Graph graph = simulate(registry, "manhattan:poses=40,streets=3");
  std::map<Id, double> prices;
  for (Id k = 0; k < 40; ++k) prices[k] = static_cast<double>((k * 17) % 41);
  Priced priced(prices);
  const std::vector<int> many = Nearest({}).choose(graph, all(graph), priced, 12),
                         few = Nearest({}).choose(graph, all(graph), priced, 6);
  ASSERT_EQ(many.size(), 12U);
  EXPECT_EQ(few, std::vector<int>(many.begin(), many.begin() + 6));
}

TEST_F(Selections, NodesWithManyNeighboursStayAsLongAsPossible) {
  Graph graph = graph_of(5, {{0, 1}, {0, 2}, {0, 3}, {3, 4}});
  for (int v = 0; v < 5; ++v) {
    constexpr std::array kPlaces{0.0, 0.1, 4.0, 8.0, 9.0};
    graph.set_state(v, std::array{kPlaces[v], 0.0, 0.0});
  }
  Priced priced({{0, 0}, {1, 9}, {2, 9}, {3, 9}, {4, 9}});
  EXPECT_THAT(Nearest({.neighbours = 3}).choose(graph, all(graph), priced, 1), ElementsAre(0));
  EXPECT_THAT(Nearest({.neighbours = 2}).choose(graph, all(graph), priced, 1), ElementsAre(1));
  EXPECT_THAT(Nearest({.neighbours = 2}).choose(graph, std::array{0}, priced, 1), ElementsAre(0));
}

TEST_F(Selections, ChooseAsManyAsAreWanted) {
  const Graph graph = chain(9);
  Priced priced({{0, 9}, {1, 1}, {2, 8}, {3, 2}, {4, 7}, {5, 3}, {6, 6}, {7, 4}, {8, 5}});
  EXPECT_THAT(Oldest(1.0).choose(graph, all(graph), nobody, 2), ElementsAre(0, 1));
  EXPECT_THAT(SmallestBlanket(1.0).choose(graph, all(graph), nobody, 2), testing::SizeIs(2));
  EXPECT_THAT(LeastLoss(1.0).choose(graph, all(graph), priced, 2), ElementsAre(1, 3));
  EXPECT_THAT(KeepEvery(2).choose(graph, all(graph), nobody, 2), ElementsAre(1, 3));
  EXPECT_THAT(KeepEvery(2).choose(graph, all(graph), nobody, 0), IsEmpty());
}

}  // namespace
}  // namespace cairn::sparsify
