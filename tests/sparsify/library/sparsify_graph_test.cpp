// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/sparsify_graph.hpp"

#include <array>
#include <atomic>
#include <cmath>
#include <memory>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/io/generator.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/loss.hpp"
#include "support/components.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

class SparsifyGraph : public ::testing::Test {
 protected:
  SparsifyJob job(const std::string& selection) {
    return {.sparsifier = parse_component("sparsify"),
            .selection = parse_component(selection),
            .optimizer = parse_component("levenberg_marquardt:linear_solver=block_cholesky")};
  }
  Graph simulate(const std::string& generator) {
    return registry_.make<Generator>(generator)->generate(registry_, 5).graph;
  }
  /// Poses in a chain without a loop, from odometry that turns a little.
  Graph chain(int poses) {
    Graph graph;
    const auto pose = registry_.variable_type("VERTEX_SE2");
    const auto edge = registry_.factor_type("EDGE_SE2");
    for (int k = 0; k < poses; ++k) {
      graph.add_variable(pose, k, std::array{double(k), 0.1 * k, 0.05 * k});
      if (k == 0) continue;
      graph.add_factor(edge, std::array{k - 1, k}, std::array{1.0, 0.1, 0.05},
                       std::vector<double>{50, 3, 1, 80, 2, 200});
    }
    graph.set_fixed(0);
    return graph;
  }
  static std::set<Id> ids(const Graph& graph) {
    std::set<Id> all;
    for (int v = 0; v < graph.variable_count(); ++v) all.insert(graph.id(v));
    return all;
  }

  Registry registry_;
  SparsifySetting setting_{.registry = registry_};
};

TEST_F(SparsifyGraph, KeepsAllOfAChain) {
  const SparsifyResult result = sparsify_whole(chain(11), job("keep_every:every=2"), setting_);
  EXPECT_EQ(result.variables_before, 11);
  EXPECT_EQ(result.factors_before, 10);
  // 0 is fixed and stays, and so does the newest.
  EXPECT_TRUE(result.sparse.find(0).has_value());
  EXPECT_TRUE(result.sparse.find(10).has_value());
  EXPECT_LE(result.sparse.variable_count(), 7);
  EXPECT_EQ(result.sparse.factor_count(), result.sparse.variable_count() - 1);
  ASSERT_TRUE(result.error.has_value());
  EXPECT_NEAR(result.error->kld, 0.0, 1e-8);  // between two neighbours one factor says it all
  EXPECT_NEAR(result.error->rmse, 0.0, 1e-8);
  EXPECT_THAT(result.notes, IsEmpty());
}

TEST_F(SparsifyGraph, TheFirstAndTheNewestPoseStayWhateverIsSelected) {
  const Graph graph = simulate("manhattan:poses=120,streets=3");
  for (const char* selection : {"smallest_blanket:part=1", "oldest:part=0.5", "least_loss:part=0.2",
                                "nearest:part=0.5", "keep_every:every=7", "coverage:distance=3"}) {
    for (const int online : {0, 20}) {
      SparsifyJob some = job(selection);
      some.measure = false;
      some.online = online;
      const SparsifyResult result = online > 0 ? sparsify_online(graph, some, setting_)
                                               : sparsify_whole(graph, some, setting_);
      EXPECT_TRUE(result.sparse.find(0).has_value()) << selection << " online " << online;
      EXPECT_TRUE(result.sparse.find(119).has_value()) << selection << " online " << online;
      EXPECT_LT(result.sparse.variable_count(), 120) << selection << " online " << online;
    }
  }
}

TEST_F(SparsifyGraph, OneOfEveryFewStaysFromTheFirstOnWhetherItIsFixedOrNot) {
  for (const bool fixed : {false, true}) {
    Graph graph = chain(16);
    graph.set_fixed(0, fixed);
    const SparsifyResult result = sparsify_whole(graph, job("keep_every:every=5"), setting_);
    EXPECT_EQ(ids(result.sparse), (std::set<Id>{0, 5, 10, 15})) << fixed;
  }
}

/// The estimate does not depend on the scale of the information, and nor does what is left of it.
TEST_F(SparsifyGraph, IsTheSameAtAnyScaleOfTheInformation) {
  const Graph graph = simulate("manhattan:poses=120,streets=3");
  for (const bool keep : {false, true}) {
    SparsifyJob half = job("smallest_blanket:part=0.5");
    half.keep_minimum = keep;
    const SparsifyResult as_it_is = sparsify_whole(graph, half, setting_);
    ASSERT_TRUE(as_it_is.error.has_value());
    for (const double scale : {1e-12, 1e-6, 1e6, 1e12}) {
      Graph scaled = graph.clone();
      for (int f = 0; f < graph.factor_count(); ++f) {
        std::vector<double> information(graph.information(f).begin(), graph.information(f).end());
        for (double& entry : information) entry *= scale;
        scaled.set_measurement(f, graph.measurement(f), information);
      }
      const SparsifyResult result = sparsify_whole(scaled, half, setting_);
      ASSERT_EQ(ids(result.sparse), ids(as_it_is.sparse)) << scale;
      ASSERT_TRUE(result.error.has_value()) << scale;
      // The divergence of the means is in units of the information; that of the covariances has
      // none.
      const double of_covariances = as_it_is.error->kld - as_it_is.error->mean;
      EXPECT_NEAR(result.error->mean, scale * as_it_is.error->mean,
                  1e-4 * result.error->mean + (keep ? 1e-9 * scale : 0.0))
          << scale;
      if (scale <= 1.0) {
        EXPECT_NEAR(result.error->kld - result.error->mean, of_covariances, 1e-4 * of_covariances)
            << scale;
      }
      EXPECT_NEAR(result.error->rmse, as_it_is.error->rmse, 1e-5) << scale;
      for (int v = 0; v < result.sparse.variable_count(); ++v) {
        const auto x = result.sparse.state(v), expected = as_it_is.sparse.state(v);
        for (std::size_t k = 0; k < x.size(); ++k) EXPECT_NEAR(x[k], expected[k], 1e-5) << scale;
      }
    }
  }
}

/// What the new factors measure is changed for that, by less than the standard deviation of most.
TEST_F(SparsifyGraph, TheMinimumStaysWhereItIs) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  for (const char* world : {"manhattan:poses=300,streets=4", "ellipse3d:poses=150"}) {
    for (const char* sparsifier :
         {"sparsify", "sparsify:topology=clt", "sparsify:topology=cliquey,recovery=closed_form"}) {
      const Graph graph = simulate(world);
      SparsifyJob some = job("smallest_blanket:part=0.7");
      some.sparsifier = parse_component(sparsifier);
      some.keep_minimum = false;
      const SparsifyResult moved = sparsify_whole(graph, some, setting_);
      some.keep_minimum = true;
      const SparsifyResult kept = sparsify_whole(graph, some, setting_);
      ASSERT_TRUE(moved.error && kept.error) << world << ' ' << sparsifier;
      EXPECT_GT(moved.error->rmse, 1e-4) << world << ' ' << sparsifier;
      EXPECT_LT(kept.error->rmse, 1e-6) << world << ' ' << sparsifier;
      EXPECT_LT(kept.error->mean, 1e-6) << world << ' ' << sparsifier;
      EXPECT_LT(kept.error->kld, moved.error->kld) << world << ' ' << sparsifier;
      EXPECT_EQ(ids(kept.sparse), ids(moved.sparse));
      ASSERT_EQ(kept.change.factors.size(), moved.change.factors.size());
      double change = 0.0;
      for (std::size_t k = 0; k < kept.change.factors.size(); ++k) {
        const Factor &a = kept.change.factors[k], &b = moved.change.factors[k];
        EXPECT_EQ(a.variables, b.variables);
        EXPECT_EQ(a.information, b.information);
        for (std::size_t i = 0; i < a.measurement.size(); ++i)
          change = std::max(change,
                            std::abs(std::remainder(a.measurement[i] - b.measurement[i], kTurn)));
      }
      EXPECT_GT(change, 0.0);
      EXPECT_LT(change, 0.3) << world << ' ' << sparsifier;
    }
  }
}

/// Landmarks and priors that are added stay as they are, and the rest is balanced beside them.
TEST_F(SparsifyGraph, OtherFactorsThanRelativePosesStay) {
  const Graph graph = simulate("landmarks2d:poses=60");
  SparsifyJob some = job("smallest_blanket:part=0.4");
  some.keep_minimum = false;
  const SparsifyResult moved = sparsify_whole(graph, some, setting_);
  some.keep_minimum = true;
  const SparsifyResult kept = sparsify_whole(graph, some, setting_);
  ASSERT_TRUE(moved.error && kept.error);
  EXPECT_LE(kept.error->kld, moved.error->kld + 1e-6);
}

TEST_F(SparsifyGraph, LosesSomethingWhereLoopsMeet) {
  const Graph graph = simulate("manhattan:poses=120,streets=3");
  const SparsifyResult result = sparsify_whole(graph, job("smallest_blanket:part=0.5"), setting_);
  EXPECT_NEAR(result.sparse.variable_count(), 60, 3);
  ASSERT_TRUE(result.error.has_value());
  EXPECT_GT(result.error->kld, 1e-6);
  EXPECT_LT(result.error->rmse, 0.1);
  EXPECT_GT(result.chi2_before, 0.0);
  EXPECT_EQ(graph.variable_count(), 120);  // untouched
}

TEST_F(SparsifyGraph, MeasuresAndOptimisesOnlyWhereAsked) {
  SparsifyJob quick = job("keep_every:every=3");
  quick.measure = false;
  quick.as_given = true;
  const SparsifyResult result =
      sparsify_whole(simulate("manhattan:poses=60,streets=3"), quick, setting_);
  EXPECT_FALSE(result.error.has_value());
  EXPECT_EQ(result.chi2_before, 0.0);
  EXPECT_GT(result.chi2_after, 0.0);
}

TEST_F(SparsifyGraph, SaysWhereAnOptimisationDidNotConverge) {
  setting_.stop.max_iterations = 1;
  const SparsifyResult result = sparsify_whole(simulate("sphere:turns=3,poses_per_turn=12"),
                                               job("keep_every:every=2"), setting_);
  EXPECT_THAT(result.notes, Not(IsEmpty()));
  EXPECT_THAT(result.notes.front(), HasSubstr("the graph ended as max_iterations"));
}

TEST_F(SparsifyGraph, EndsEarlyWhenInterrupted) {
  std::atomic<bool> interrupt = false;
  setting_.stop.interrupt = &interrupt;
  setting_.progress = [&](const SparsifyProgress& progress) {
    if (progress.phase == SparsifyProgress::Phase::remove && progress.done >= 3) interrupt = true;
  };
  const SparsifyResult result =
      sparsify_whole(simulate("manhattan:poses=60,streets=3"), job("keep_every:every=2"), setting_);
  EXPECT_TRUE(result.interrupted);
  EXPECT_FALSE(result.error.has_value());
  EXPECT_LT(result.change.removed_variables.size(), 20U);
}

TEST_F(SparsifyGraph, RefusesNamesThatThereAreNot) {
  EXPECT_THROW(sparsify_whole(chain(4), job("no_such_selection"), setting_), Error);
}

// Online ------------------------------------------------------------------------------------------

TEST_F(SparsifyGraph, OnlineAChainKeepsAllItsInformation) {
  SparsifyJob online = job("keep_every:every=2");
  online.online = 4;
  std::vector<int> done;
  setting_.progress = [&](const SparsifyProgress& progress) {
    if (progress.phase == SparsifyProgress::Phase::feed) done.push_back(progress.done);
  };
  const SparsifyResult result = sparsify_online(chain(21), online, setting_);
  EXPECT_THAT(done, SizeIs(21));
  EXPECT_EQ(done.back(), 21);
  EXPECT_THAT(result.steps, SizeIs(21));
  EXPECT_EQ(result.redirected, 0);  // odometry alone never meets a node that has left
  EXPECT_EQ(result.dropped, 0);
  EXPECT_LT(result.sparse.variable_count(), 14);
  ASSERT_TRUE(result.error.has_value());
  EXPECT_NEAR(result.error->kld, 0.0, 1e-8);
  EXPECT_NEAR(result.rmse_full, 0.0, 1e-8);
}

/// Nothing connects the second chain, and in the end one pose or a few are left of it.
TEST_F(SparsifyGraph, OnlineWhatCannotBeComparedCostsTheMeasureAlone) {
  Graph graph = chain(12), both;
  for (int v = 0; v < 12; ++v) {
    const auto x = graph.state(v);
    both.add_variable(graph.type_of(v), v < 6 ? v : 100 + v, x);
  }
  for (int f = 0; f < graph.factor_count(); ++f) {
    const Factor factor = graph.factor(f);
    if (f == 5) continue;  // from one chain to the other
    both.add_factor(factor.type, std::array{f, f + 1}, factor.measurement, factor.information);
  }
  for (const char* selection : {"oldest:part=0.5", "keep_every:every=2"}) {
    for (const int every : {1, 2, 3, 4}) {
      SparsifyJob online = job(selection);
      online.online = every;
      const SparsifyResult result = sparsify_online(both, online, setting_);
      EXPECT_TRUE(result.sparse.find(111).has_value()) << selection << " " << every;
      EXPECT_TRUE(result.error.has_value() || !result.notes.empty()) << selection << " " << every;
    }
  }
}

TEST_F(SparsifyGraph, OnlineNewFactorsHaveNoLoss) {
  CAIRN_NEEDS("loss", "cauchy");
  setting_.loss = std::shared_ptr<const Loss>(registry_.make<Loss>("cauchy"));
  SparsifyJob online = job("keep_every:every=2");
  online.online = 4;
  const SparsifyResult result = sparsify_online(chain(21), online, setting_);
  int without = 0;
  for (int f = 0; f < result.sparse.factor_count(); ++f) {
    double rho = 0.0;
    const std::array s{9.0};
    ASSERT_NE(result.sparse.loss(f), nullptr);
    result.sparse.loss(f)->evaluate(s, {&rho, 1}, {});
    without += rho == 9.0;
  }
  EXPECT_EQ(without, std::ssize(result.change.removed_variables));  // ρ(s) = s
}

TEST_F(SparsifyGraph, OnlineRedirectsLoopClosuresOfNodesThatHaveLeft) {
  const Graph graph = simulate("manhattan:poses=150,streets=3");
  SparsifyJob online = job("keep_every:every=3");
  online.online = 10;
  const SparsifyResult late = sparsify_online(graph, online, setting_);
  EXPECT_GT(late.redirected, 0);
  EXPECT_LT(late.sparse.variable_count(), 75);
  EXPECT_TRUE(std::isfinite(late.rmse_full));
  ASSERT_TRUE(late.error.has_value());

  // Of nodes that are known to leave, factors are redirected while they are still there.
  online.redirect_early = 3;
  const SparsifyResult early = sparsify_online(graph, online, setting_);
  EXPECT_GE(early.redirected + early.dropped, late.redirected + late.dropped);
  EXPECT_EQ(ids(early.sparse), ids(late.sparse));
}

TEST_F(SparsifyGraph, OnlineWithoutRemovalsIsTheWholeGraph) {
  const Graph graph = simulate("manhattan:poses=60,streets=3");
  SparsifyJob online = job("keep_every:every=1");
  online.online = 10;
  const SparsifyResult result = sparsify_online(graph, online, setting_);
  EXPECT_EQ(ids(result.sparse), ids(graph));
  EXPECT_EQ(result.sparse.factor_count(), graph.factor_count());
  EXPECT_NEAR(result.chi2_after, result.chi2_before, 1e-6 * result.chi2_before);
  EXPECT_NEAR(result.rmse_full, 0.0, 1e-4);
}

}  // namespace
}  // namespace cairn
