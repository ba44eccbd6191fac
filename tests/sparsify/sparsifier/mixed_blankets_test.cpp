// SPDX-License-Identifier: BSD-3-Clause
// Blankets with landmarks and absolute measurements, against dense algebra and brute force.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "blanket_matrices.hpp"
#include "cairn/sparsification/sparsifier.hpp"
#include "local_problem.hpp"
#include "recovery.hpp"
#include "sparsify/sparsifier/blankets.hpp"
#include "sparsify/sparsifier/world.hpp"
#include "topologies.hpp"

namespace cairn::sparsify {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;
using testing::Gt;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Lt;
using testing::SizeIs;

class MixedBlankets : public testing::TestWithParam<int> {};

/// Every topology of so many pairs that connects all nodes, landmarks at the ends.
std::vector<std::vector<FactorChoice>> every_tree(const DenseBlanket& blanket) {
  std::vector<int> pairs;
  for (int k = 0; k < static_cast<int>(std::ssize(blanket.models)); ++k) {
    if (blanket.models[k].nodes.size() == 2) pairs.push_back(k);
  }
  const auto n = static_cast<int>(std::ssize(blanket.node_sizes));
  std::vector<std::vector<FactorChoice>> trees;
  for (unsigned set = 0; set < 1U << pairs.size(); ++set) {
    if (__builtin_popcount(set) != n - 1) continue;
    std::vector<FactorChoice> tree;
    std::vector<int> seen(n, 0);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      if ((set >> k & 1U) == 0) continue;
      tree.push_back({pairs[k]});
      for (const int node : blanket.models[pairs[k]].nodes) ++seen[node];
    }
    bool ends = connects(blanket, tree);
    for (int node = 0; node < n; ++node)
      ends = ends && (!blanket.is_landmark(node) || seen[node] == 1);
    if (ends) trees.push_back(std::move(tree));
  }
  return trees;
}

/// The KLD of the topology's optimum by its definition, with Ω = (J Σ Jᵀ)⁻¹.
double tree_kld(const DenseBlanket& blanket, const std::vector<FactorChoice>& topology) {
  const int d = blanket.size();
  const Matrix T = coordinates(project(blanket, Projection::node), d);
  Matrix sparse = Matrix::Zero(d, d);
  for (const FactorChoice& choice : topology) {
    const Matrix J = jacobian(blanket.models[choice.front()], d);
    sparse += J.transpose() * (J * T * T.transpose() * J.transpose()).inverse() * J;
  }
  return dense_kld(T.transpose() * sparse * T);
}

std::vector<int> priors(const DenseBlanket& blanket) {
  std::vector<int> all;
  for (int k = 0; k < static_cast<int>(std::ssize(blanket.models)); ++k) {
    if (blanket.models[k].nodes.size() == 1) all.push_back(k);
  }
  return all;
}

TEST_P(MixedBlankets, ThePriorOfTheLeastSpreadIsTheBestOfEveryTree) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    World world(GetParam(), seed);
    for (Id id = 0; id < 5; ++id) world.pose(id);
    for (Id id = 1; id < 5; ++id) world.relate(0, id);
    world.relate(1, 2);
    world.place(0);
    const DenseBlanket blanket = world.blanket({0});
    ASSERT_TRUE(blanket.absolute);
    const std::vector<int> places = priors(blanket);
    ASSERT_THAT(places, SizeIs(4));
    std::set<int> best_places;
    double least = std::numeric_limits<double>::infinity();
    const auto trees = every_tree(blanket);
    ASSERT_THAT(trees, SizeIs(16));  // Cayley: 4²
    for (const std::vector<FactorChoice>& tree : trees) {
      std::vector<double> klds;
      for (const int prior : places) {
        std::vector<FactorChoice> topology = tree;
        topology.push_back({prior});
        klds.push_back(tree_kld(blanket, topology));
        // The closed form is the optimum of these factors.
        const RecoveryProblem problem =
            project(blanket, Projection::node).problem(blanket, topology);
        EXPECT_THAT(ClosedForm().recover(problem).kld, DoubleNear(klds.back(), 1e-8));
      }
      const auto best = std::ranges::min_element(klds);
      best_places.insert(places[best - klds.begin()]);
      least = std::min(least, *best);
    }
    EXPECT_THAT(best_places, SizeIs(1));
    const std::vector<FactorChoice> chosen = ChowLiuTree(TopologyOptions{}).choose(blanket, 0);
    ASSERT_THAT(chosen, SizeIs(4));
    EXPECT_EQ(chosen.back().front(), *best_places.begin());
    EXPECT_THAT(tree_kld(blanket, chosen), DoubleNear(least, 1e-9));
    EXPECT_THAT(least, Gt(1e-3));
  }
}

TEST_P(MixedBlankets, ThePriorIsAsGoodWithMoreFactorsThanATree) {
  World world(GetParam(), 11);
  for (Id id = 0; id < 5; ++id) world.pose(id);
  for (Id id = 1; id < 5; ++id) world.relate(0, id);
  world.place(0);
  const DenseBlanket blanket = world.blanket({0});
  const std::vector<FactorChoice> chosen = MutualInformation(TopologyOptions{}).choose(blanket, 6);
  ASSERT_THAT(chosen, SizeIs(6));
  const auto kld = [&](int prior) {
    std::vector<FactorChoice> topology = chosen;
    for (FactorChoice& choice : topology) {
      if (blanket.models[choice.front()].nodes.size() == 1) choice = {prior};
    }
    return FactorDescent({.tolerance = 1e-7}, true)
        .recover(project(blanket, Projection::node).problem(blanket, topology))
        .kld;
  };
  double least = std::numeric_limits<double>::infinity(), own = least;
  for (const int prior : priors(blanket)) {
    const double found = kld(prior);
    least = std::min(least, found);
    if (std::ranges::find(chosen, FactorChoice{prior}) != chosen.end()) own = found;
  }
  EXPECT_THAT(own, DoubleNear(least, 1e-8));
}

TEST_P(MixedBlankets, LandmarksHangOnThePosesThatAreBest) {
  for (unsigned seed = 20; seed < 24; ++seed) {
    for (const bool absolute : {false, true}) {
      World world(GetParam(), seed);
      for (Id id = 0; id < 4; ++id) world.pose(id);
      for (Id id = 10; id < 12; ++id) world.landmark(id);
      for (Id id = 1; id < 4; ++id) world.relate(0, id);
      for (Id id = 10; id < 12; ++id) world.observe(0, id);
      world.observe(1, 10);
      if (absolute) world.place(0);
      const DenseBlanket blanket = world.blanket({0});
      EXPECT_EQ(blanket.absolute, absolute);
      const auto trees = every_tree(blanket);
      ASSERT_THAT(trees, SizeIs(27));  // 3 trees of poses, 3 poses for each landmark
      double least = std::numeric_limits<double>::infinity();
      for (std::vector<FactorChoice> tree : trees) {
        if (!absolute) {
          least = std::min(least, tree_kld(blanket, tree));
          continue;
        }
        for (const int prior : priors(blanket)) {
          tree.push_back({prior});
          least = std::min(least, tree_kld(blanket, tree));
          tree.pop_back();
        }
      }
      EXPECT_THAT(tree_kld(blanket, ChowLiuTree(TopologyOptions{}).choose(blanket, 0)),
                  DoubleNear(least, 1e-9));
      // And more factors lose less.
      double before = least;
      for (const int more : {2, 4}) {
        const std::vector<FactorChoice> chosen =
            ExpectedDivergence(TopologyOptions{}).choose(blanket, 4 + (absolute ? 1 : 0) + more);
        const double kld = FactorDescent({.tolerance = 1e-6}, true)
                               .recover(project(blanket, Projection::node).problem(blanket, chosen))
                               .kld;
        EXPECT_THAT(kld, Lt(before));
        before = kld;
      }
    }
  }
}

/// All of the graph is one blanket, so its divergence is that of the whole.
TEST_P(MixedBlankets, TheDivergenceIsThatOfTheGraphs) {
  for (const std::string options :
       {"topology=clt,recovery=closed_form", "topology=ekld", "topology=mi", "topology=dmi",
        "topology=odd", "topology=l1", "topology=best", "projection=eigen"}) {
    for (const bool absolute : {false, true}) {
      SCOPED_TRACE(options + (absolute ? ", absolute" : ""));
      World world(GetParam(), 31);
      for (Id id = 0; id < 4; ++id) world.pose(id);
      for (Id id = 10; id < 12; ++id) world.landmark(id);
      for (Id id = 1; id < 4; ++id) world.relate(0, id);
      for (Id id = 10; id < 12; ++id) world.observe(0, id);
      if (absolute) world.place(0);
      const std::string sparsifier = "sparsify:population=tree:1.5," + options;
      const Sparsification change = world.removal({0}, sparsifier);
      EXPECT_THAT(change.refused, IsEmpty());
      const Graph sparse = world.without({0}, sparsifier);
      const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
      EXPECT_THAT(change.kld, DoubleNear(dense_divergence(all, left), 1e-6));
      EXPECT_THAT(change.kld, Gt(1e-3));
    }
  }
}

TEST_P(MixedBlankets, MergedChainsLoseNothing) {
  World world(GetParam(), 41);
  for (Id id = 0; id < 6; ++id) world.pose(id);
  world.landmark(10);
  for (Id id = 1; id < 6; ++id) world.relate(id - 1, id);
  world.observe(0, 10);
  world.observe(5, 10);
  world.place(3);
  for (const std::vector<Id>& removed : {std::vector<Id>{1}, {1, 2}, {4}}) {
    const Sparsification change = world.removal(removed);
    EXPECT_THAT(change.kld, DoubleNear(0.0, 1e-9));
    const Graph sparse = world.without(removed);
    const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
    EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
  }
}

TEST_P(MixedBlankets, TheEndOfAChainLeavesItsLandmarkAndPriorToTheNext) {
  World world(GetParam(), 42);
  for (Id id = 0; id < 3; ++id) world.pose(id);
  world.landmark(10);
  world.relate(0, 1);
  world.relate(1, 2);
  world.observe(2, 10);
  for (const bool absolute : {false, true}) {
    if (absolute) {
      world.graph.remove(std::vector<bool>{false, false, true}, std::vector<bool>(4));
      world.place(2);
      world.place(1);
    }
    const Graph sparse = world.without({2});
    EXPECT_EQ(sparse.factor_count(), 2);  // the two priors of 1 have become one
    const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
    EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
  }
}

// Landmarks that leave ----------------------------------------------------------------------------

/// Each pose may turn about the landmark that has left: new factors do not claim to know how far.
TEST_P(MixedBlankets, ALandmarkLeavesFactorsOfLowerRank) {
  for (const int observers : {2, 3, 5}) {
    World world(GetParam(), 50 + static_cast<unsigned>(observers));
    for (Id id = 0; id < observers; ++id) world.pose(id);
    world.landmark(10);
    world.landmark(11);
    for (Id id = 0; id < observers; ++id) world.observe(id, 10);
    world.pose(20);  // elsewhere in the graph: such a factor is the type of the new ones
    world.relate(0, 20);
    const Sparsification change = world.removal({10}, "sparsify:population=tree:1");
    EXPECT_THAT(change.refused, IsEmpty());
    const Graph sparse = world.without({10}, "sparsify:population=tree:1");
    EXPECT_EQ(sparse.factor_count(), observers);
    const Matrix all = marginal_of(world.graph, sparse), left = marginal_of(sparse, sparse);
    EXPECT_THAT(dense_divergence(all, left), DoubleNear(change.kld, 1e-6));
    if (observers == 2) {
      EXPECT_THAT(apart(all / all.norm(), left / all.norm()), Lt(1e-9));
    } else {
      EXPECT_THAT(change.kld, Gt(1e-3));
    }
  }
}

TEST_P(MixedBlankets, ALandmarkThatIsPlacedInTheWorldLeavesAPrior) {
  World world(GetParam(), 60);
  for (Id id = 0; id < 3; ++id) world.pose(id);
  world.landmark(10);
  for (Id id = 0; id < 2; ++id) world.observe(id, 10);
  world.relate(0, 1);
  world.place(10);
  world.relate(1, 2);
  world.place(2);
  const Sparsification change = world.removal({10});
  EXPECT_THAT(change.refused, IsEmpty());
  const Graph sparse = world.without({10});
  std::vector<std::string> tags;
  for (int f = 0; f < sparse.factor_count(); ++f) tags.emplace_back(sparse.factor_type(f).tag());
  const std::string prior = world.plane() ? "EDGE_PRIOR_SE2" : "EDGE_PRIOR_SE3:QUAT";
  EXPECT_EQ(std::ranges::count(tags, prior), 2);
  EXPECT_EQ(sparse.factor_count(), 4);
}

// Refusals ----------------------------------------------------------------------------------------

TEST(MixedBlanketRefusals, NameTheNodeAndTheReason) {
  World world(2, 70);
  for (Id id = 0; id < 4; ++id) world.pose(id);
  for (Id id = 10; id < 13; ++id) world.landmark(id);
  world.observe(0, 10);
  world.observe(0, 11);
  world.relate(1, 2);
  world.place(11);
  EXPECT_THAT(world.refusal(0), HasSubstr("VERTEX_SE2 0 has only landmarks as neighbours"));
  EXPECT_THAT(world.refusal(11),
              HasSubstr("VERTEX_XY 11 has an absolute measurement, and no factor "
                        "of the graph measures a whole pose"));
  EXPECT_THAT(world.refusal(10), IsEmpty());
  world.graph.set_fixed(world.index(1));
  EXPECT_THAT(world.refusal(1), HasSubstr("VERTEX_SE2 1 is held"));
}

INSTANTIATE_TEST_SUITE_P(InThePlaneAndInSpace, MixedBlankets, testing::Values(2, 3));

}  // namespace
}  // namespace cairn::sparsify
