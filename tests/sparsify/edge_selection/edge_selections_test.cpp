// SPDX-License-Identifier: BSD-3-Clause
#include "edge_selections.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/information/gaussian.hpp"
#include "cairn/runtime/error.hpp"
#include "sparsify/edge_selection/loop_graphs.hpp"
#include "support/components.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"

namespace cairn::edges {
namespace {

using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::SizeIs;
using testing::ThrowsMessage;

class EdgeSelections : public testing::Test {
 protected:
  void SetUp() override { CAIRN_NEEDS("linear_solver", "block_cholesky"); }

  EdgeChoice choose(const std::string& selection, const Graph& graph) {
    return registry.make<EdgeSelection>(selection)->choose(graph,
                                                           find_loop_closures(graph).candidates);
  }
  Registry registry;
};

double connectivity(const Graph& graph, EdgeWeight weight = EdgeWeight::rotation) {
  return dense_connectivity(graph, relative_edges(graph, all_factors(graph)), weight);
}

/// n_t ln |L_t| + n_r ln |L_r| without the row and column of the first pose, which is fixed.
double tree_connectivity(const Graph& graph) {
  const std::vector<RelativeEdge> edges = relative_edges(graph, all_factors(graph));
  const auto n = graph.variable_count() - 1;
  const int positions = graph.type(0).placement()->dimension();
  const auto of = [&](EdgeWeight weight) {
    return test::log_determinant_of(dense_laplacian(graph, edges, weight).bottomRightCorner(n, n));
  };
  return positions * of(EdgeWeight::translation) +
         (graph.type(0).tangent_size() - positions) * of(EdgeWeight::rotation);
}

double log_information(const Graph& graph) {
  return test::log_determinant_of(test::dense_system(graph).H);
}

/// The divergence of the covariances of two graphs with the same states.
double divergence(const Graph& full, const Graph& sparse) {
  const auto gaussian = [](const Graph& graph) {
    const test::DenseSystem system = test::dense_system(graph);
    return Gaussian{Eigen::VectorXd::Zero(system.g.size()), system.Sigma()};
  };
  return kullback_leibler(gaussian(full), gaussian(sparse)).total();
}

using Value = std::function<double(const Graph&)>;

/// Greedily, every gain a difference of two dense values.
std::vector<int> naive_greedy(const Graph& graph, int count, const Value& value) {
  const std::vector<int> candidates = find_loop_closures(graph).candidates;
  std::vector<int> stay;
  while (static_cast<int>(std::ssize(stay)) < count) {
    double best = -std::numeric_limits<double>::infinity();
    std::vector<int> best_stay;
    for (const int f : candidates) {
      const auto place = std::ranges::lower_bound(stay, f);
      if (place != stay.end() && *place == f) continue;
      std::vector<int> with = stay;
      with.insert(with.begin() + (place - stay.begin()), f);
      if (const double of_with = value(with_candidates(graph, candidates, with)); of_with > best) {
        best = of_with;
        best_stay = with;
      }
    }
    stay = best_stay;
  }
  return stay;
}

struct Extremes {
  double least = std::numeric_limits<double>::infinity();
  double most = -std::numeric_limits<double>::infinity();
  double mean = 0.0;
};

/// Of all choices of as many.
Extremes of_all_choices(const Graph& graph, int count, const Value& value) {
  const std::vector<int> candidates = find_loop_closures(graph).candidates;
  Extremes all;
  int choices = 0;
  for_each_choice(
      static_cast<int>(std::ssize(candidates)), count, [&](const std::vector<int>& numbers) {
        const double x = value(with_candidates(graph, candidates, at(candidates, numbers)));
        all.least = std::min(all.least, x);
        all.most = std::max(all.most, x);
        all.mean += (x - all.mean) / ++choices;
      });
  return all;
}

Graph chosen(const Graph& graph, const EdgeChoice& choice) {
  return with_candidates(graph, find_loop_closures(graph).candidates, choice.stay);
}

// Greedy ------------------------------------------------------------------------------------------

TEST_F(EdgeSelections, GreedyChoicesAreThoseOfDenseDeterminants) {
  for (const int dimension : {2, 3}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      Registry types;
      const Graph graph = random_loops(types, dimension, 10, 16, seed);
      EXPECT_EQ(choose("greedy_tree:part=0.5", graph).stay,
                naive_greedy(graph, 8, tree_connectivity));
      EXPECT_EQ(choose("greedy_gain:part=0.5", graph).stay,
                naive_greedy(graph, 8, log_information));
      EXPECT_EQ(
          choose("greedy_gain:part=0.5,objective=divergence", graph).stay,
          naive_greedy(graph, 8, [&](const Graph& sparse) { return -divergence(graph, sparse); }));
    }
  }
}

/// Nemhauser, Wolsey and Fisher 1978, of what is gained beyond the backbone.
TEST_F(EdgeSelections, GreedyChoicesKeepTheirGuarantee) {
  const double guarantee = 1.0 - std::exp(-1.0);
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Graph graph = random_loops(registry, 2, 7, 9, seed);
    for (const auto& [name, value] : std::map<std::string, Value>{
             {"greedy_tree", tree_connectivity}, {"greedy_gain", log_information}}) {
      const double none = value(chosen(graph, {}));
      const double best = of_all_choices(graph, 4, value).most - none;
      const double greedy = value(chosen(graph, choose(name + ":part=0.44", graph))) - none;
      EXPECT_LE(greedy, best + 1e-9) << name;
      EXPECT_GE(greedy, guarantee * best) << name;
    }
  }
}

// Relaxations -------------------------------------------------------------------------------------

TEST_F(EdgeSelections, TheBoundOfMacHoldsForEveryChoice) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const Graph graph = random_loops(registry, 2, 9, 10, seed);
    for (const EdgeWeight weight : {EdgeWeight::rotation, EdgeWeight::translation}) {
      const Extremes all = of_all_choices(
          graph, 4, [&](const Graph& sparse) { return connectivity(sparse, weight); });
      const EdgeChoice choice =
          choose("mac:part=0.4,iterations=2000,weight=" + std::string(to_string(weight)), graph);
      ASSERT_THAT(choice.stay, SizeIs(4));
      ASSERT_TRUE(choice.connectivity_bound);
      EXPECT_EQ(choice.connectivity_weight, weight);
      EXPECT_GE(*choice.connectivity_bound, all.most * (1.0 - 1e-9));
      EXPECT_LE(*choice.connectivity_bound, 1.5 * all.most);  // is not trivial
      const double found = connectivity(chosen(graph, choice), weight);
      EXPECT_GE(found, 0.7 * all.most);
      EXPECT_GE(found, 1.3 * all.mean);
      EXPECT_LE(found, all.most * (1.0 + 1e-9));
    }
  }
}

TEST_F(EdgeSelections, TheBoundOfL1HoldsForEveryChoice) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Graph graph = random_loops(registry, 2, 8, 9, seed);
    const Value value = [&](const Graph& sparse) { return divergence(graph, sparse); };
    const Extremes all = of_all_choices(graph, 4, value);
    const EdgeChoice choice = choose("l1:part=0.44,iterations=2000", graph);
    ASSERT_THAT(choice.stay, SizeIs(4));
    ASSERT_TRUE(choice.kld_bound);
    EXPECT_LE(*choice.kld_bound, all.least * (1.0 + 1e-9));
    EXPECT_GE(*choice.kld_bound, 0.1 * all.least);
    const double found = value(chosen(graph, choice));
    EXPECT_GE(found, all.least * (1.0 - 1e-9));
    EXPECT_LE(found, 1.2 * all.least);
  }
}

// -------------------------------------------------------------------------------------------------

TEST_F(EdgeSelections, RandomChoicesDependOnTheSeedAlone) {
  const Graph graph = random_loops(registry, 2, 12, 40, 2);
  const EdgeChoice once = choose("random:part=0.25,seed=4", graph);
  EXPECT_THAT(once.stay, SizeIs(10));
  EXPECT_EQ(choose("random:part=0.25,seed=4", graph).stay, once.stay);
  EXPECT_NE(choose("random:part=0.25,seed=5", graph).stay, once.stay);
  std::map<int, int> counts;
  for (int seed = 0; seed < 1000; ++seed) {
    for (const int f : choose("random:part=0.25,seed=" + std::to_string(seed), graph).stay)
      ++counts[f];
  }
  EXPECT_EQ(counts.size(), 40U);
  for (const auto& [factor, count] : counts) EXPECT_NEAR(count, 250, 70) << factor;
}

TEST_F(EdgeSelections, KeepThePartThatIsAskedFor) {
  const Graph graph = random_loops(registry, 3, 12, 20, 3);
  const std::vector<int> candidates = find_loop_closures(graph).candidates;
  for (const std::string& name : registry.names(EdgeSelection::kKind)) {
    for (const auto& [part, expected] : {std::pair{"0", 0}, {"0.1", 2}, {"0.62", 12}, {"1", 20}}) {
      const EdgeChoice choice = choose(name + ":part=" + part, graph);
      EXPECT_THAT(choice.stay, SizeIs(expected)) << name;
      EXPECT_TRUE(std::ranges::is_sorted(choice.stay));
      EXPECT_THAT(candidates, IsSupersetOf(choice.stay)) << name;
    }
  }
}

TEST_F(EdgeSelections, EndWhenTheyAreInterrupted) {
  const Graph graph = random_loops(registry, 2, 12, 20, 3);
  const std::vector<int> candidates = find_loop_closures(graph).candidates;
  for (const std::string name : {"mac", "l1", "greedy_tree", "greedy_gain"}) {
    for (const int last : {0, 3}) {
      int calls = 0;
      const EdgeChoice choice =
          registry.make<EdgeSelection>(name)->choose(graph, candidates, [&](int done, int total) {
            EXPECT_LT(done, total);
            return calls++ < last;
          });
      EXPECT_FALSE(choice.complete) << name;
      EXPECT_FALSE(choice.connectivity_bound || choice.kld_bound) << name;
      EXPECT_EQ(calls, last + 1) << name;
    }
  }
}

/// The selections measure distances by what the factors measure: a scale of the information of all
/// factors changes no choice.
TEST_F(EdgeSelections, DoNotDependOnTheUnitOfInformation) {
  const Graph graph = random_loops(registry, 2, 12, 20, 8);
  Graph scaled = graph.clone();
  for (int f = 0; f < graph.factor_count(); ++f) {
    std::vector<double> information(graph.information(f).begin(), graph.information(f).end());
    for (double& x : information) x *= 0x1p-12;
    const auto z = graph.measurement(f);
    scaled.set_measurement(f, std::vector<double>(z.begin(), z.end()), information);
  }
  for (const std::string name : {"mac", "l1", "greedy_tree", "greedy_gain"})
    EXPECT_EQ(choose(name, scaled).stay, choose(name, graph).stay) << name;
}

TEST_F(EdgeSelections, MacRefusesWhatItIsNotDefinedFor) {
  Graph two = random_loops(registry, 2, 8, 6, 1);
  const Graph other = random_loops(registry, 2, 5, 3, 2);
  for (int v = 0; v < other.variable_count(); ++v) {
    Variable moved = other.variable(v);
    moved.id += 100;
    two.add(moved);
  }
  for (int f = 0; f < other.factor_count(); ++f) {
    Factor moved = other.factor(f);
    for (Id& id : moved.variables) id += 100;
    two.add(moved);
  }
  EXPECT_THAT([&] { choose("mac", two); },
              ThrowsMessage<Error>(HasSubstr("the poses in 2 components")));
  // The others are.
  for (const std::string name : {"l1", "greedy_tree", "greedy_gain"})
    EXPECT_THAT(choose(name + ":part=0.34", two).stay, SizeIs(3)) << name;
}

}  // namespace
}  // namespace cairn::edges
