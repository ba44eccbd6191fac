// SPDX-License-Identifier: BSD-3-Clause
// The initial guess that chooses: which start it takes, and that it is the best by chi2.
#include <algorithm>
#include <cmath>
#include <random>
#include <span>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/second_look.hpp"
#include "cairn/evaluation/watched_guess.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {
namespace {

using testing::AllOf;
using testing::Contains;
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

TEST_F(Automatic, TriesNothingWhereTheGivenAnglesAgreeWithAllMeasurements) {
  Graph graph = std::move(simulate("manhattan:poses=400,rotation_sigma=0.001").graph);
  const Values given = graph.values();
  EXPECT_THAT(guess("auto", graph),
              ElementsAre(AllOf(StartsWith("as_given (chi2"), HasSubstr("no measurement disagrees"),
                                Not(HasSubstr("chordal")))));
  EXPECT_EQ(graph.values().pools, given.pools);
  Graph chordal = graph.clone();
  guess("chordal", chordal);
  const double expected = optimize(chordal).final_chi2;
  EXPECT_NEAR(optimize(graph).final_chi2, expected, 1e-9 * expected);
}

// Around a circle of a hundred steps all states at the origin disagree with each measurement by
// little, and end in a minimum without the turn.
TEST_F(Automatic, LooksForAnotherStartThanStatesThatAreAllAlike) {
  Graph graph = std::move(simulate("ring:poses=100").graph), right = graph.clone();
  for (int v = 0; v < graph.variable_count(); ++v) graph.set_state(v, std::vector(3, 0.0));
  EXPECT_THAT(guess("auto", graph), Contains(StartsWith("chordal")));
  const double expected = optimize(right).final_chi2;
  EXPECT_NEAR(optimize(graph).final_chi2, expected, 1e-6 * expected);
}

TEST_F(Automatic, FindsTheMinimumWhereTheGivenStatesEndInAnother) {
  // With this much noise in the headings, steps from odometry end in a local minimum.
  Graph graph = std::move(simulate("manhattan:poses=1500,rotation_sigma=0.1").graph);
  Graph stuck = graph.clone(), chordal = graph.clone();
  guess("chordal", chordal);
  const double from_chordal = optimize(chordal).final_chi2;
  ASSERT_GT(optimize(stuck).final_chi2, 1.2 * from_chordal);
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
  EXPECT_THAT(guess("auto", graph), IsEmpty()) << "no start was tried";
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

// Minima that others do not reach ---------------------------------------------------------------

/// chi2 of what `cairn optimize` does by default, and its notes.
Summary optimize_by_default(Registry& registry, Graph& graph) {
  const auto guess = registry.make<InitialGuess>("auto");
  const auto optimizer = registry.make<Optimizer>("levenberg_marquardt");
  Observer silent;
  return optimize(graph, {*optimizer, "levenberg_marquardt", guess.get(), "auto"}, {}, silent);
}

class OtherMinimaOf : public Automatic {
 protected:
  Simulation simulate(const std::string& world, std::uint64_t seed) {
    return registry.make<Generator>(world)->generate(registry, seed);
  }
  double from(Graph graph, const Values& states) {
    graph.set_values(states);
    return optimize(graph).final_chi2;
  }
};

TEST_F(OtherMinimaOf, GivenStatesThatLeadLowerAreKept) {
  // A few iterations from the truth are behind as many from the chordal start.
  Simulation simulation = simulate("city:poses=131,block=6,noise=1.94,rotation_sigma=0.119", 102);
  Graph& graph = simulation.graph;
  const double best = from(graph.clone(), simulation.truth.values());
  Graph chordal = graph.clone();
  guess("chordal", chordal);
  ASSERT_GT(optimize(chordal).final_chi2, 1.05 * best);
  graph.set_values(simulation.truth.values());
  const std::vector<std::string> notes = guess("auto", graph);
  EXPECT_THAT(notes, ElementsAre(AllOf(StartsWith("as_given (chi2 524.5, after"),
                                       HasSubstr(" iterations 107.8)"),
                                       HasSubstr("; not chordal (chi2 1806, after"))));
  EXPECT_LT(optimize(graph).final_chi2, 1.001 * best);
}

TEST_F(OtherMinimaOf, ATrajectoryWithNoisyHeadingsAreFound) {
  // Loops that few measurements close, whose headings are known up to full turns.
  struct Case {
    const char* world;
    std::uint64_t seed;
  };
  for (const Case& one : {Case{"ring:poses=183,noise=2.19,rotation_sigma=0.1", 926},
                          Case{"ring:poses=100,noise=2.97,rotation_sigma=0.1", 943},
                          Case{"ring:poses=155,noise=2.81,rotation_sigma=0.1", 969},
                          Case{"ellipse3d:poses=84,noise=2.90,rotation_sigma=0.1", 482}}) {
    SCOPED_TRACE(one.world);
    if (!registry.has("types", "slam3d")) GTEST_SKIP() << "there are no types slam3d";
    Simulation simulation = simulate(one.world, one.seed);
    const double best = from(simulation.graph.clone(), simulation.truth.values());
    Graph chordal = simulation.graph.clone();
    guess("chordal", chordal);
    ASSERT_GT(optimize(chordal).final_chi2, 1.01 * best);
    const Summary summary = optimize_by_default(registry, simulation.graph);
    EXPECT_LT(summary.final_chi2, 1.001 * best);
    EXPECT_EQ(summary.final_chi2, chi2(simulation.graph));
    EXPECT_EQ(summary.status, Status::converged);
    EXPECT_THAT(summary.notes,
                Contains(AllOf(StartsWith("initial guess auto: looked for other"),
                               HasSubstr("since chi2 fell"), HasSubstr("instead of"))));
    for (std::size_t k = 0; k < summary.iterations.size(); ++k)
      EXPECT_EQ(summary.iterations[k].number, static_cast<int>(k) + 1);
  }
}

TEST_F(OtherMinimaOf, AGraphThatStartsNearItsMinimumAreNotSought) {
  Graph graph = std::move(simulate("manhattan:poses=400", 7).graph);
  int looks = 0;
  const auto made = registry.make<InitialGuess>("auto");
  query<WatchedGuess>(*made)->watch([&](std::string_view what, double) {
    looks += what == "other starts";
    return true;
  });
  made->compute(graph);
  const Summary summary = optimize(graph);
  const SecondLook::Result result = query<SecondLook>(*made)->look_again(graph, summary);
  EXPECT_FALSE(result.lower);
  EXPECT_THAT(result.notes, IsEmpty());
  EXPECT_EQ(looks, 0);
}

TEST_F(OtherMinimaOf, ASearchThatIsEndedLeavesTheBestSoFar) {
  Simulation simulation = simulate("ring:poses=100,noise=2.97,rotation_sigma=0.1", 943);
  Graph& graph = simulation.graph;
  const auto made = registry.make<InitialGuess>("auto");
  made->compute(graph);
  const Summary summary = optimize(graph);
  const Values before = graph.values();
  query<WatchedGuess>(*made)->watch(
      [](std::string_view what, double) { return what != "other starts"; });
  EXPECT_FALSE(query<SecondLook>(*made)->look_again(graph, summary).lower);
  EXPECT_EQ(graph.values().pools, before.pools);
}

/// chi2 from the chordal start without a second look.
double from_chordal(Registry& registry, Graph graph) {
  registry.make<InitialGuess>("chordal")->compute(graph);
  return registry.make<Optimizer>("levenberg_marquardt")
      ->optimize(graph, {.max_iterations = 500})
      .final_chi2;
}

TEST_F(OtherMinimaOf, MeasurementsThatContradictEachOtherBeyondChanceAreFound) {
  Simulation simulation =
      simulate("landmarks2d:poses=140,sensor=cartesian,noise=5,outliers=6", 1905734870);
  const double before = from_chordal(registry, simulation.graph.clone());
  const Summary summary = optimize_by_default(registry, simulation.graph);
  EXPECT_LT(summary.final_chi2, 0.65 * before);
  EXPECT_THAT(summary.notes, Contains(AllOf(HasSubstr("looked for other minima, since chi2 is"),
                                            HasSubstr("times the 232 degrees of freedom"))));
}

/// As if sigmas were larger by the root of that.
void scale_information(Graph& graph, double by) {
  for (int f = 0; f < graph.factor_count(); ++f) {
    std::vector<double> information(graph.information(f).begin(), graph.information(f).end());
    for (double& entry : information) entry *= by;
    const std::vector<double> measured(graph.measurement(f).begin(), graph.measurement(f).end());
    graph.set_measurement(f, measured, information);
  }
}

TEST_F(OtherMinimaOf, ASmallGraphWhoseInformationIsTooSmallAreFound) {
  // chi2 is far below what it may be, whatever is wrong.
  struct Case {
    const char* world;
    std::uint64_t seed;
  };
  for (const Case& one : {Case{"landmarks2d:poses=80,sensor=cartesian,noise=20,outliers=5", 3},
                          Case{"city:poses=100,noise=20,outliers=6", 7},
                          Case{"ring:poses=80,noise=5,outliers=4", 3}}) {
    SCOPED_TRACE(one.world);
    Simulation simulation = simulate(one.world, one.seed);
    scale_information(simulation.graph, 1e-4);
    const double before = from_chordal(registry, simulation.graph.clone());
    const Summary summary = optimize_by_default(registry, simulation.graph);
    EXPECT_LT(summary.final_chi2, 0.9 * before);
    EXPECT_THAT(summary.notes,
                Contains(AllOf(HasSubstr("looked for other minima, since poses disagree with a"),
                               HasSubstr(" rad, and chi2 is 0.00"))));
  }
}

/// By which the poses of a relative measurement disagree with it [rad].
double largest_turn(const Graph& graph) {
  double largest = 0.0;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto ends = graph.factor_variables(f);
    if (ends.size() != 2) continue;
    const VariableType& type = graph.type(ends[0]);
    const auto R = [&](std::span<const double> state) { return pose_of(type, state).R; };
    largest = std::max(
        largest, rotation_angle(R(graph.measurement(f)).transpose() *
                                R(graph.state(ends[0])).transpose() * R(graph.state(ends[1]))));
  }
  return largest;
}

TEST_F(OtherMinimaOf, ASmallGraphWhoseChi2IsAsItShouldBeAreNotSought) {
  if (!registry.has("types", "slam3d")) GTEST_SKIP() << "there are no types slam3d";
  // Poses disagree with measurements by as much as above, and as much as their information says.
  Simulation simulation = simulate("grid3d:nx=4,ny=4,nz=4,noise=5", 3);
  const auto made = registry.make<InitialGuess>("auto");
  int looks = 0;
  query<WatchedGuess>(*made)->watch([&](std::string_view what, double) {
    looks += what == "other starts";
    return true;
  });
  made->compute(simulation.graph);
  const Summary summary = optimize(simulation.graph);
  EXPECT_GT(largest_turn(simulation.graph), 0.25);
  EXPECT_THAT(query<SecondLook>(*made)->look_again(simulation.graph, summary).notes, IsEmpty());
  EXPECT_EQ(looks, 0);
}

/// The odometry and the last loop closure.
Graph with_one_loop(const Graph& graph) {
  Graph result;
  std::vector<int> kept;
  int last = -1;
  for (int v = 0; v < graph.variable_count(); ++v)
    result.add_variable(graph.type_of(v), graph.id(v), graph.state(v));
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto ends = graph.factor_variables(f);
    if (std::abs(graph.id(ends[1]) - graph.id(ends[0])) == 1)
      kept.push_back(f);
    else
      last = f;
  }
  kept.push_back(last);
  for (const int f : kept) {
    const auto ends = graph.factor_variables(f);
    result.add_factor(graph.type_of_factor(f), std::vector<int>(ends.begin(), ends.end()),
                      graph.measurement(f), graph.information(f));
  }
  return result;
}

TEST_F(OtherMinimaOf, AFewPosesThatTurnFarAreSoughtToTheEnd) {
  // The first starts all lead back, and one at random does not.
  if (!registry.has("types", "slam3d")) GTEST_SKIP() << "there are no types slam3d";
  for (const std::uint64_t seed : {14, 44}) {
    Graph graph = with_one_loop(
        simulate("sphere:turns=3,poses_per_turn=12,noise=5,rotation_sigma=0.1", seed).graph);
    const double before = from_chordal(registry, graph.clone());
    EXPECT_LT(optimize_by_default(registry, graph).final_chi2, 0.75 * before);
  }
}

TEST_F(OtherMinimaOf, MeasurementsThatContradictEachOtherAreDoubted) {
  Simulation simulation = simulate("manhattan:poses=60,loop_density=0.5,noise=5,outliers=4", 2);
  const Summary summary = optimize_by_default(registry, simulation.graph);
  EXPECT_EQ(summary.status, Status::converged);
  EXPECT_THAT(summary.doubts,
              Contains(AllOf(HasSubstr("measurements contradict each other, or their information"),
                             HasSubstr(" starts ended in other minima"))));
}

TEST_F(OtherMinimaOf, MeasurementsThatALossRejectsAreTakenBack) {
  if (!registry.has("loss", "cauchy")) GTEST_SKIP() << "there is no loss cauchy";
  Simulation simulation =
      simulate("landmarks2d:poses=126,sensor=bearing_range,outliers=20", 693969830);
  simulation.graph.set_loss(registry.make<Loss>("cauchy"));
  const double before = from_chordal(registry, simulation.graph.clone());
  const Summary summary = optimize_by_default(registry, simulation.graph);
  EXPECT_LT(summary.final_chi2, 0.65 * before);
  EXPECT_THAT(summary.notes, Contains(HasSubstr("since losses reject measurements")));
}

TEST_F(OtherMinimaOf, ManyThatAreNearlyAsLowAreSaid) {
  // Each turn is known to 6 rad, that is, not at all: what is lowest is a matter of chance.
  Simulation simulation =
      simulate("ring:poses=58,laps=3.544,noise=20,rotation_sigma=0.3", 793332501);
  const Summary summary = optimize_by_default(registry, simulation.graph);
  EXPECT_THAT(summary.doubts, Contains(AllOf(HasSubstr("chi2 has many minima: "),
                                             HasSubstr("there may be a lower one than chi2"))));
}

class BoundedLoss : public OtherMinimaOf, public testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    OtherMinimaOf::SetUp();
    if (!registry.has("loss", GetParam())) GTEST_SKIP() << "there is no loss " << GetParam();
  }
  /// chi2 by default against that from the truth.
  void reaches_what_the_truth_leads_to(const std::string& world, std::uint64_t seed) {
    SCOPED_TRACE(world);
    Simulation simulation = simulate(world, seed);
    Graph& graph = simulation.graph;
    graph.set_loss(registry.make<Loss>(GetParam()), FactorSelector::loops());
    std::vector<const Loss*> before;
    for (int f = 0; f < graph.factor_count(); ++f) before.push_back(graph.loss(f));
    const double best = from(graph.clone(), simulation.truth.values());
    const Summary summary = optimize_by_default(registry, graph);
    EXPECT_LT(summary.final_chi2, 1.001 * best);
    EXPECT_THAT(summary.notes, Not(Contains(HasSubstr("hardly"))));
    for (int f = 0; f < graph.factor_count(); ++f) EXPECT_EQ(graph.loss(f), before[f]);
  }
};

TEST_P(BoundedLoss, OfRightLoopClosuresLeavesTheEstimateInItsMinimum) {
  if (!registry.has("types", "slam3d")) GTEST_SKIP() << "there are no types slam3d";
  reaches_what_the_truth_leads_to("torus:turns=4,poses_per_turn=14", 11);
  reaches_what_the_truth_leads_to("torus:turns=8,poses_per_turn=8", 5);
  reaches_what_the_truth_leads_to("ellipse3d:poses=64", 118);
}

TEST_P(BoundedLoss, FindsTheMinimumAmongWrongLoopClosures) {
  reaches_what_the_truth_leads_to("ring:poses=170,outliers=5", 104);
  reaches_what_the_truth_leads_to("ring:poses=45,outliers=7", 70);
  reaches_what_the_truth_leads_to("ring:poses=147,outliers=7", 40);
}

INSTANTIATE_TEST_SUITE_P(Losses, BoundedLoss,
                         testing::Values("dcs", "geman_mcclure", "tukey", "welsch"));

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
