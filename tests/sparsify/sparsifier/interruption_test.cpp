// SPDX-License-Identifier: BSD-3-Clause
// Long work within a blanket asks whether to go on, and ends where it is told to.
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "recovery.hpp"
#include "sparsify.hpp"
#include "sparsify/sparsifier/blankets.hpp"
#include "topologies.hpp"

namespace cairn::sparsify {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

class Interrupted : public testing::Test {
 protected:
  DenseBlanket blanket(int nodes) {
    Draw draw(3);
    return random_blanket(registry, 2, nodes, draw, 2 * nodes);
  }
  Registry registry;
};

/// Counts how often it was asked, and says no from the n-th time on.
struct Asked {
  int no_from = 0, times = 0;
  bool operator()() { return ++times < no_from; }
};

TEST_F(Interrupted, TopologiesEndInTheMiddle) {
  const DenseBlanket large = blanket(12), small = blanket(7);
  std::vector<std::pair<std::string, std::unique_ptr<Topology>>> all;
  all.emplace_back("ekld", std::make_unique<ExpectedDivergence>(TopologyOptions{}));
  all.emplace_back("l1", std::make_unique<SparseInverse>(SparseInverseOptions{}));
  all.emplace_back("best", std::make_unique<Exhaustive>(ExhaustiveOptions{}));
  // More topologies than it may try: what takes its place asks too.
  all.emplace_back("best:most=1", std::make_unique<Exhaustive>(ExhaustiveOptions{.most = 1}));
  for (const auto& [name, topology] : all) {
    const DenseBlanket& on = name == "best" ? small : large;
    const int population = name == "best" ? 7 : 22;
    const std::vector<FactorChoice> whole = topology->choose(on, population);
    Asked asked{.no_from = 4};
    topology->watch(std::ref(asked));
    EXPECT_THROW(topology->choose(on, population), Interruption) << name;
    EXPECT_EQ(asked.times, 4) << name;
    // Afterwards, and watched by somebody who lets it go on, it is as before.
    Asked patient{.no_from = 1 << 30};
    topology->watch(std::ref(patient));
    EXPECT_EQ(topology->choose(on, population), whole) << name;
    EXPECT_GT(patient.times, 4) << name;
  }
}

TEST_F(Interrupted, RecoveriesEndInTheMiddle) {
  const DenseBlanket large = blanket(12);
  const std::vector<FactorChoice> topology =
      ExpectedDivergence(TopologyOptions{}).choose(large, 22);
  const RecoveryProblem problem =
      BlanketProjection(large, Projection::eigen).problem(large, topology);
  const RecoveryOptions options{.tolerance = 1e-9};
  std::vector<std::pair<std::string, std::unique_ptr<FactorRecovery>>> all;
  all.emplace_back("fd", std::make_unique<FactorDescent>(options, false));
  all.emplace_back("ncfd", std::make_unique<FactorDescent>(options, true));
  all.emplace_back("ip",
                   std::make_unique<InteriorPoint>(InteriorPointOptions{.recovery = options}));
  all.emplace_back("pqn", std::make_unique<ProjectedQuasiNewton>(
                              ProjectedQuasiNewtonOptions{.recovery = options}));
  for (const auto& [name, recovery] : all) {
    const double whole = recovery->recover(problem).kld;
    Asked asked{.no_from = 4};
    recovery->watch(std::ref(asked));
    EXPECT_THROW(recovery->recover(problem), Interruption) << name;
    EXPECT_EQ(asked.times, 4) << name;
    recovery->watch({});
    EXPECT_EQ(recovery->recover(problem).kld, whole) << name;
  }
}

/// A topology that works until it is told to stop, in the second blanket.
class Endless final : public Topology {
 public:
  std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) override {
    if (++calls_ == 1) return ChowLiuTree(TopologyOptions{}).choose(blanket, population);
    while (true) check_interruption();
  }

 private:
  int calls_ = 0;
};

TEST_F(Interrupted, WhatIsNotFinishedStaysAsItWas) {
  const Graph graph = solved(registry, "manhattan:poses=60,loop_density=0.5");
  Sparsify sparsify(std::make_unique<Endless>(), std::make_unique<ClosedForm>(), {});
  std::vector<int> done;
  const std::vector<int> nodes{20, 40};
  const Sparsification change = sparsify.remove(graph, nodes, [&](int count) {
    done.push_back(count);
    return done.size() < 3;  // after the first blanket, and twice within the second
  });
  EXPECT_THAT(done, ElementsAre(1, 1, 1));
  EXPECT_THAT(change.removed_variables, ElementsAre(20));
  EXPECT_THAT(change.refused, IsEmpty());
  EXPECT_EQ(change.problems, 1);
  Graph sparse = graph.clone();
  apply(change, sparse);
  EXPECT_EQ(sparse.variable_count(), graph.variable_count() - 1);
  // The same as if only the first had been asked for.
  Sparsify once(std::make_unique<ChowLiuTree>(TopologyOptions{}), std::make_unique<ClosedForm>(),
                {});
  const Sparsification alone = once.remove(graph, std::vector<int>{20}, {});
  EXPECT_EQ(change.removed_factors, alone.removed_factors);
  ASSERT_THAT(change.factors, SizeIs(alone.factors.size()));
  for (std::size_t k = 0; k < alone.factors.size(); ++k)
    EXPECT_EQ(change.factors[k].information, alone.factors[k].information);
}

}  // namespace
}  // namespace cairn::sparsify
