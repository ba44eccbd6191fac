// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/sparsify_edges.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/io/generator.hpp"
#include "cairn/runtime/error.hpp"
#include "support/dense_algebra.hpp"
#include "support/dense_system.hpp"

namespace cairn::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::ThrowsMessage;

class SparsifyEdges : public testing::Test {
 protected:
  SparsifyEdgesJob job(const std::string& selection) {
    return {.selection = parse_component(selection),
            .optimizer = parse_component("levenberg_marquardt:linear_solver=block_cholesky")};
  }
  Graph simulate(const std::string& generator) {
    return registry_.make<Generator>(generator)->generate(registry_, 5).graph;
  }
  Graph town() { return simulate("manhattan:poses=60,streets=3,block=2,loop_density=0.5"); }

  Registry registry_;
  SparsifySetting setting_{.registry = registry_};
};

TEST_F(SparsifyEdges, AllPosesStayAndAPartOfTheLoopClosures) {
  const Graph graph = town();
  for (const std::string& name : registry_.names(EdgeSelection::kKind)) {
    const SparsifyEdgesResult result = sparsify_edges(graph, job(name + ":part=0.25"), setting_);
    const SparsifyResult& whole = result.whole;
    const auto loops = std::ssize(result.closures.candidates);
    EXPECT_EQ(whole.sparse.variable_count(), graph.variable_count()) << name;
    EXPECT_EQ(whole.sparse.factor_count(),
              graph.factor_count() - loops + std::lround(0.25 * static_cast<double>(loops)));
    EXPECT_EQ(result.closures.odometry, 59);
    ASSERT_TRUE(whole.error) << name;
    EXPECT_GT(whole.error->kld, 0.0);
    EXPECT_LT(whole.error->rmse_aligned, 0.5);
    EXPECT_LE(result.choice.kld_bound.value_or(0.0), whole.error->covariance);
    for (const Connectivity& of : result.connectivity) {
      EXPECT_GT(of.sparse, 0.0);
      EXPECT_LT(of.sparse, of.full);
      EXPECT_FALSE(of.bound < of.sparse);  // NaN: there is none
    }
    EXPECT_EQ(std::isfinite(result.connectivity[0].bound), name == "mac");
    EXPECT_THAT(whole.notes, IsEmpty());
  }
}

TEST_F(SparsifyEdges, NothingIsLostWhereAllStay) {
  const SparsifyEdgesResult result = sparsify_edges(town(), job("greedy_gain:part=1"), setting_);
  EXPECT_NEAR(result.whole.error->kld, 0.0, 1e-7);
  EXPECT_NEAR(result.whole.error->rmse, 0.0, 1e-7);
  EXPECT_NEAR(result.connectivity[0].sparse, result.connectivity[0].full,
              1e-9 * result.connectivity[0].full);
  EXPECT_THAT(result.whole.change.removed_factors, IsEmpty());
}

/// Factors that stay keep their information: Λ − Λ̆ is positive semidefinite at common states.
TEST_F(SparsifyEdges, NoInformationIsAdded) {
  const SparsifyEdgesResult result = sparsify_edges(town(), job("greedy_tree"), setting_);
  Graph full = town();
  full.set_values(result.whole.sparse.values());
  const Eigen::MatrixXd less = dense_system(full).H - dense_system(result.whole.sparse).H;
  EXPECT_GE(eigenvalues_of(less)[0], -1e-9 * less.norm());
}

/// Of one start the choice by information has lost less than chance, as the method is for.
TEST_F(SparsifyEdges, GreedyLosesLessThanChance) {
  const auto kld = [&](const std::string& selection) {
    return sparsify_edges(simulate("manhattan:poses=400,streets=5"), job(selection), setting_)
        .whole.error->kld;
  };
  double chance = std::numeric_limits<double>::infinity();
  for (int seed = 1; seed <= 5; ++seed)
    chance = std::min(chance, kld("random:part=0.25,seed=" + std::to_string(seed)));
  for (const char* name : {"greedy_tree:part=0.25", "greedy_gain:part=0.25", "l1:part=0.25"})
    EXPECT_LT(kld(name), chance) << name;
}

TEST_F(SparsifyEdges, WithoutLoopClosuresThereIsNothingToChooseFrom) {
  EXPECT_THAT(
      [&] {
        sparsify_edges(simulate("manhattan:poses=20,loop_density=0"), job("random"), setting_);
      },
      ThrowsMessage<Error>(HasSubstr("there are no loop closures to choose from")));
  EXPECT_THAT([&] { sparsify_edges(town(), job("nobody"), setting_); }, testing::Throws<Error>());
}

TEST_F(SparsifyEdges, LeavesAllInWhenInterrupted) {
  std::atomic<bool> interrupt = false;
  setting_.stop.interrupt = &interrupt;
  setting_.progress = [&](const SparsifyProgress& progress) {
    EXPECT_EQ(progress.phase, SparsifyProgress::Phase::edges);
    if (progress.done >= 3) interrupt = true;
  };
  const SparsifyEdgesResult result = sparsify_edges(town(), job("greedy_gain"), setting_);
  EXPECT_TRUE(result.whole.interrupted);
  EXPECT_EQ(result.whole.sparse.factor_count(), town().factor_count());
  EXPECT_FALSE(result.whole.error);
  EXPECT_THAT(result.whole.notes, SizeIs(1));
}

/// Chooses something that it was not offered.
class Wrong final : public EdgeSelection {
 public:
  EdgeChoice choose(const Graph&, std::span<const int>, const Step&) override {
    return {.stay = {0}};
  }
};

TEST_F(SparsifyEdges, APluginThatChoosesSomethingElseIsNamed) {
  registry_.add<EdgeSelection>("wrong", {},
                               [](const Options&, Registry&) { return std::make_unique<Wrong>(); });
  EXPECT_THAT([&] { sparsify_edges(town(), job("wrong"), setting_); },
              ThrowsMessage<Error>(HasSubstr("'wrong' returned factors that are not candidates")));
}

TEST_F(SparsifyEdges, LandmarksAndPriorsStay) {
  Graph graph = simulate("landmarks2d:poses=60");
  const LoopClosures closures = find_loop_closures(graph);
  if (closures.candidates.empty()) {  // one across, so that there is something to choose from
    const Factor loop = graph.factor(closures.backbone.front());
    graph.add(loop);
  }
  const SparsifyEdgesResult result = sparsify_edges(graph, job("greedy_gain:part=0"), setting_);
  EXPECT_EQ(result.whole.sparse.factor_count(),
            graph.factor_count() - std::ssize(result.closures.candidates));
  ASSERT_TRUE(result.whole.error);
  EXPECT_GT(result.whole.error->kld, 0.0);
}

}  // namespace
}  // namespace cairn::test
