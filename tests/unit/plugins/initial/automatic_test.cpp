// SPDX-License-Identifier: BSD-3-Clause
// The initial guess that chooses: which start it takes, and that it is the best by chi2.
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

class Automatic : public testing::Test {
 protected:
  void SetUp() override {
    for (const auto& [kind, name] : {std::pair("generator", "manhattan"),
                                     {"linear_solver", "block_cholesky"},
                                     {"optimizer", "levenberg_marquardt"},
                                     {"types", "slam2d"}}) {
      if (!registry.has(kind, name)) GTEST_SKIP() << "there is no " << kind << " " << name;
    }
  }
  Simulation simulate(const std::string& world) {
    return registry.make<Generator>(world)->generate(registry, 7);
  }
  std::vector<std::string> guess(const std::string& name, Graph& graph) {
    return registry.make<InitialGuess>(name)->compute(graph);
  }
  Summary optimize(Graph& graph) {
    return registry.make<Optimizer>("levenberg_marquardt")
        ->optimize(graph, {.max_iterations = 500});
  }

  Registry registry;
};

TEST_F(Automatic, TakesTheChordalStartOfAGraphThatStartsFarAway) {
  Graph graph = std::move(simulate("manhattan:poses=400").graph), chordal = graph.clone();
  const double given = chi2(graph);
  guess("chordal", chordal);
  ASSERT_LT(chi2(chordal), given);
  EXPECT_THAT(guess("auto", graph),
              ElementsAre(AllOf(StartsWith("chordal (chi2"), HasSubstr("; not as_given (chi2"))));
  EXPECT_EQ(graph.values().pools, chordal.values().pools);
}

TEST_F(Automatic, LeavesAnOptimisedGraphAsItIs) {
  Graph graph = std::move(simulate("manhattan:poses=400").graph);
  guess("auto", graph);
  ASSERT_EQ(optimize(graph).status, Status::converged);
  const Values before = graph.values();
  EXPECT_THAT(guess("auto", graph), ElementsAre(StartsWith("as_given (chi2")));
  EXPECT_EQ(graph.values().pools, before.pools);
}

TEST_F(Automatic, FindsTheMinimumWhereTheGivenStatesEndInAnother) {
  // With this much noise in the headings, steps from odometry end in a local minimum.
  Graph graph = std::move(simulate("manhattan:poses=1500,rotation_sigma=0.1").graph);
  Graph stuck = graph.clone(), chordal = graph.clone();
  guess("chordal", chordal);
  const double from_chordal = optimize(chordal).final_chi2;
  ASSERT_GT(optimize(stuck).final_chi2, 1.5 * from_chordal);
  guess("auto", graph);
  EXPECT_NEAR(optimize(graph).final_chi2, from_chordal, 1e-6 * from_chordal);
  guess("auto", stuck);
  EXPECT_NEAR(optimize(stuck).final_chi2, from_chordal, 1e-6 * from_chordal);
}

TEST_F(Automatic, TriesTheIncrementalEstimateWhereTheOthersAreImplausible) {
  Graph graph =
      std::move(simulate("landmarks2d:poses=600,sensor=bearing_range,rotation_sigma=0.3").graph);
  // Headings that mean nothing: no few iterations lead from there to a plausible estimate.
  const std::vector<std::string> notes = guess("auto:iterations=1", graph);
  ASSERT_THAT(notes, Not(IsEmpty()));
  EXPECT_THAT(notes.front(), HasSubstr("incremental (chi2"));
}

TEST_F(Automatic, KeepsGivenStatesWhereNothingElseApplies) {
  if (!registry.has("types", "bundle")) GTEST_SKIP() << "there are no types bundle";
  Graph graph = std::move(simulate("bundle").graph);
  const Values before = graph.values();
  guess("auto", graph);
  EXPECT_EQ(graph.values().pools, before.pools);
}

TEST_F(Automatic, CountsRobustLosses) {
  if (!registry.has("loss", "cauchy")) GTEST_SKIP() << "there is no loss cauchy";
  Graph graph = std::move(simulate("manhattan:poses=400").graph);
  graph.set_loss(registry.make<Loss>("cauchy"));
  const double given = chi2(graph);
  guess("auto", graph);
  EXPECT_LE(chi2(graph), given);
}

TEST_F(Automatic, IncrementalEstimatesKeepTheLossOfEachFactor) {
  if (!registry.has("loss", "cauchy")) GTEST_SKIP() << "there is no loss cauchy";
  Simulation simulation = simulate("manhattan:poses=300");
  Graph& graph = simulation.graph;
  ASSERT_EQ(graph.factor_type(0).tag(), "EDGE_SE2");
  // Loop closures that say that far poses are one.
  const std::vector<double> information = {1e4, 0, 0, 1e4, 0, 1e4};
  for (const int first : {10, 60, 110}) {
    const int ends[] = {first, first + 150};
    graph.add_factor(graph.type_of_factor(0), ends, std::vector<double>{0, 0, 0}, information);
  }
  graph.set_loss(registry.make<Loss>("cauchy"), FactorSelector::parse("loops"));
  Graph from_truth = graph.clone();
  from_truth.set_values(simulation.truth.values());
  const double minimum = optimize(from_truth).final_chi2;
  guess("incremental", graph);
  EXPECT_LT(chi2(graph), 1.01 * minimum);
}

TEST(Plausibility, IsChi2PerDegreeOfFreedom) {
  EXPECT_TRUE(is_plausible(2500.0, 100));
  EXPECT_FALSE(is_plausible(2501.0, 100));
  EXPECT_FALSE(is_plausible(std::nan(""), 100));
  EXPECT_TRUE(is_plausible(7.0, 0));
  EXPECT_TRUE(is_plausible(7.0, -3));
}

TEST_F(Automatic, DegreesOfFreedomAreResidualsMinusUnknowns) {
  const Graph graph = std::move(simulate("manhattan:poses=50").graph);
  EXPECT_EQ(degrees_of_freedom(graph, resolve_gauge(graph)), graph.residual_size() - 3 * 49);
  EXPECT_THAT(implausible_estimate(graph, 10.0), IsEmpty());
  EXPECT_THAT(implausible_estimate(graph, 1e9), HasSubstr("times the"));
}

}  // namespace
}  // namespace cairn
