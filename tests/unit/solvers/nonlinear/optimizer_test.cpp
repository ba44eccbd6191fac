// SPDX-License-Identifier: BSD-3-Clause
// What every optimizer owes besides what `cairn plugins --check` asks.
#include "cairn/solve/optimizer.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "support/components.hpp"
#include "support/sample_graphs.hpp"

namespace cairn::test {
namespace {

using testing::Contains;
using testing::HasSubstr;

/// Counts what it is told, and does something after each iteration.
class Recorder final : public Observer {
 public:
  std::function<bool(const Iteration&)> after = [](const Iteration&) { return true; };

  void on_start(const Graph&, double chi2) override {
    EXPECT_TRUE(iterations.empty());
    ++starts;
    initial_chi2 = chi2;
  }
  bool on_iteration(const Iteration& iteration, const Graph& graph, const Values& values) override {
    iterations.push_back(iteration);
    Graph seen = graph.clone();
    seen.set_values(values);
    best_chi2.push_back(chi2_of(seen));
    return after(iteration);
  }
  void on_message(std::string_view message) override { messages.emplace_back(message); }

  int starts = 0;
  double initial_chi2 = 0.0;
  std::vector<Iteration> iterations;
  std::vector<double> best_chi2;  // of the states handed over
  std::vector<std::string> messages;
};

bool takes_linear_solver(Registry& registry, const std::string& spec) {
  const OptionSpec* option =
      registry.options("optimizer", parse_component(spec).name).find("linear_solver");
  return option && option->type == OptionType::component;
}

class OptimizerTest : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    const std::string spec = with_some_linear_solver(GetParam());
    if (spec.empty()) GTEST_SKIP() << "there is no linear solver";
    optimizer_ = registry_.make<Optimizer>(spec);
  }
  void TearDown() override { set_threads(0); }
  bool is_ceres() const { return GetParam().rfind("ceres", 0) == 0; }
  /// Needs as many iterations as the condition number says, which are more than these tests allow;
  /// then that has to be its status.
  bool falls_short(Status status) const {
    const bool slow = GetParam().find("steepest_descent") != std::string::npos ||
                      GetParam().find("nonlinear_conjugate_gradient") != std::string::npos ||
                      GetParam().find("scaling=none") != std::string::npos;
    return slow && status == Status::max_iterations;
  }

  Registry registry_;
  std::unique_ptr<Optimizer> optimizer_;
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(OptimizerTest);
INSTANTIATE_TEST_SUITE_P(Registered, OptimizerTest, testing::ValuesIn(every_component("optimizer")),
                         test_name);

TEST_P(OptimizerTest, ReachesTheMinimum) {
  if (GetParam() == "ceres:linear_solver_type=cgnr") GTEST_SKIP() << "its steps are inexact";
  const Stop stop{.max_iterations = 1000};
  std::vector<std::pair<const char*, Graph>> samples;
  samples.emplace_back("ring", ring_of_poses(40, 0.05));
  samples.emplace_back("noisy ring", ring_of_poses(25, 0.15));
  samples.emplace_back("poses and points", poses_and_points(30, 0.05));
  samples.emplace_back("large residuals", large_residuals(0.5));
  samples.emplace_back("larger residuals", large_residuals(0.9));
  for (auto& [name, graph] : samples) {
    SCOPED_TRACE(name);
    const double expected = dense_minimum(graph);
    const Summary summary = optimizer_->optimize(graph, stop);
    if (falls_short(summary.status)) continue;
    EXPECT_EQ(summary.status, Status::converged);
    EXPECT_NEAR(summary.final_chi2, expected, 1e-8 * expected);
    EXPECT_NEAR(chi2_of(graph), summary.final_chi2, 1e-13 * expected);
  }
}

// Ceres ends the process for numbers that it does not expect.
TEST_P(OptimizerTest, EndsAtOnceWhereChi2IsNotFinite) {
  for (const double far : {1e200, 1e307}) {
    Graph graph = ring_of_poses(10, 0.1);
    for (int v = 0; v < graph.variable_count(); ++v) {
      std::vector<double> x(graph.state(v).begin(), graph.state(v).end());
      x[0] = far * (0.1 * v);
      graph.set_state(v, x);
    }
    const Summary summary = optimizer_->optimize(graph);
    EXPECT_EQ(summary.status, Status::diverged) << far;
    EXPECT_FALSE(std::isfinite(summary.initial_chi2)) << far;
    EXPECT_FALSE(std::isfinite(summary.final_chi2)) << far;
    EXPECT_TRUE(summary.iterations.empty()) << far;
    EXPECT_THAT(summary.notes, Contains(HasSubstr("not finite"))) << far;
  }
}

TEST_P(OptimizerTest, EndsWhereResidualsVanish) {
  Graph graph = rosenbrock();
  const Summary summary = optimizer_->optimize(graph, Stop{.max_iterations = 500});
  if (falls_short(summary.status)) return;
  EXPECT_EQ(summary.status, Status::converged);
  EXPECT_LT(summary.final_chi2, 1e-18);
  EXPECT_LT(summary.iterations.size(), 100U);
}

// Gauss-Newton steps across Rosenbrock's valley, to a chi2 much larger, and from there to the
// minimum.
TEST(LevenbergMarquardt, TakesASecondStepWhereTheFirstRaisesChi2) {
  Registry registry;
  if (!registry.has("optimizer", "levenberg_marquardt"))
    GTEST_SKIP() << "there is no optimizer levenberg_marquardt";
  const auto optimizer = registry.make<Optimizer>("levenberg_marquardt");
  Graph graph = rosenbrock();
  const Summary summary = optimizer->optimize(graph, Stop{.max_iterations = 3, .tolerance = 0.0});
  EXPECT_LT(summary.iterations.front().chi2, 1e-10);
  EXPECT_TRUE(summary.iterations.front().accepted);
  // The last iteration that is allowed cannot be two.
  Graph again = rosenbrock();
  const Summary one = optimizer->optimize(again, Stop{.max_iterations = 1, .tolerance = 0.0});
  EXPECT_LE(one.final_chi2, one.initial_chi2);
}

TEST_P(OptimizerTest, AgreesWhateverTheLinearSolver) {
  if (!takes_linear_solver(registry_, GetParam()))
    GTEST_SKIP() << GetParam() << " takes no linear solver of ours";
  const double expected = dense_minimum(poses_and_points(20, 0.05));
  for (const std::string& solver : registry_.names("linear_solver")) {
    SCOPED_TRACE(solver);
    ComponentSpec spec = parse_component(GetParam());
    spec.values["linear_solver"] = solver;
    Graph graph = poses_and_points(20, 0.05);
    const Summary summary = registry_.make<Optimizer>(spec)->optimize(graph);
    EXPECT_EQ(summary.linear_solver, solver);
    EXPECT_NEAR(summary.final_chi2, expected, 1e-10 * expected);
    EXPECT_GT(summary.solver.factor_nonzeros + summary.solver.iterations, 0) << "says nothing";
  }
}

TEST_P(OptimizerTest, RunsExactlyTheIterationsAskedFor) {
  for (const int iterations : {1, 3, 20}) {
    if (is_ceres() && iterations > 3)
      continue;  // Ceres ends by itself where no step lowers its cost
    Graph graph = ring_of_poses(20, 0.1);
    const Summary summary =
        optimizer_->optimize(graph, Stop{.max_iterations = iterations, .tolerance = 0.0});
    EXPECT_EQ(summary.iterations.size(), static_cast<std::size_t>(iterations));
    EXPECT_EQ(summary.status, Status::max_iterations);
    EXPECT_EQ(summary.final_chi2, chi2_of(graph))
        << "the estimate in the graph is not the one reported";
  }
}

TEST_P(OptimizerTest, TellsTheObserverOfEachIteration) {
  Graph graph = ring_of_poses(30, 0.1);
  const double before = chi2_of(graph);
  Recorder recorder;
  const Summary summary = optimizer_->optimize(graph, Stop{}, recorder);
  EXPECT_EQ(recorder.starts, 1);
  EXPECT_NEAR(recorder.initial_chi2, before, 1e-13 * before);
  ASSERT_EQ(recorder.iterations.size(), summary.iterations.size());
  double best = before;
  for (std::size_t k = 0; k < recorder.iterations.size(); ++k) {
    EXPECT_EQ(recorder.iterations[k].number, static_cast<int>(k) + 1);
    EXPECT_EQ(recorder.iterations[k].chi2, summary.iterations[k].chi2);
    best = std::min(best, recorder.iterations[k].chi2);
    EXPECT_NEAR(recorder.best_chi2[k], best, 1e-12 * before)
        << "the states handed over are not the best so far";
  }
  EXPECT_NEAR(summary.final_chi2, best, 1e-12 * before);
}

TEST_P(OptimizerTest, AnchorsAFreeGaugeAndSaysSo) {
  Graph graph = ring_of_poses(20, 0.1);
  const std::vector<double> first(graph.state(0).begin(), graph.state(0).end());
  Recorder recorder;
  const Summary summary = optimizer_->optimize(graph, Stop{}, recorder);
  EXPECT_THAT(summary.notes, Contains(HasSubstr("VERTEX_SE2 0")));
  EXPECT_THAT(recorder.messages, Contains(HasSubstr("VERTEX_SE2 0")));
  EXPECT_THAT(graph.state(0), testing::ElementsAreArray(first));
  EXPECT_FALSE(graph.fixed(0)) << "an anchor is not the graph's";
}

TEST_P(OptimizerTest, ConvergesAtOnceWhereEverythingIsHeld) {
  Graph graph = everything_held();
  const double before = chi2_of(graph);
  const Summary summary = optimizer_->optimize(graph);
  EXPECT_EQ(summary.status, Status::converged);
  EXPECT_TRUE(summary.iterations.empty());
  EXPECT_NEAR(summary.initial_chi2, before, 1e-13 * before);
  EXPECT_NEAR(summary.final_chi2, before, 1e-13 * before);
  Graph nothing;
  EXPECT_EQ(optimizer_->optimize(nothing).status, Status::converged);
}

TEST_P(OptimizerTest, NeverLeavesAWorseEstimate) {
  for (const double far : {0.5, 3.0, 100.0}) {
    Graph graph = overshooting(far);
    const Summary summary = optimizer_->optimize(graph, Stop{.max_iterations = 200});
    EXPECT_LE(summary.final_chi2, summary.initial_chi2);
    EXPECT_NEAR(chi2_of(graph), summary.final_chi2, 1e-13 * summary.initial_chi2);
    if (GetParam() == "gauss_newton") {
      EXPECT_NE(summary.status, Status::converged) << "whole steps cannot arrive from " << far;
    } else if (!falls_short(summary.status)) {
      EXPECT_LT(summary.final_chi2, 1e-12) << "from " << far;
    }
  }
}

TEST_P(OptimizerTest, GivesTheSameBitsForAnyNumberOfThreads) {
  if (is_ceres()) GTEST_SKIP() << "Ceres adds up in the order of its threads";
  Graph first;
  for (const int count : {1, 2, 3}) {
    set_threads(count);
    Graph graph = ring_of_poses(600, 0.05);
    optimizer_->optimize(graph);
    if (count == 1) {
      first = std::move(graph);
    } else {
      EXPECT_EQ(graph.values().pools, first.values().pools) << count << " threads";
    }
  }
}

TEST_P(OptimizerTest, ConvergesAtOnceFromItsOwnResult) {
  Graph graph = ring_of_poses(30, 0.1);
  const Summary first = optimizer_->optimize(graph);
  if (falls_short(first.status)) GTEST_SKIP() << "its own result is not the minimum";
  const Summary again = optimizer_->optimize(graph);
  EXPECT_EQ(again.status, Status::converged);
  EXPECT_LE(again.iterations.size(), 6U);
  EXPECT_NEAR(again.final_chi2, first.final_chi2, 1e-10 * first.final_chi2);
}

TEST_P(OptimizerTest, AccountsForItsTime) {
  Graph graph = ring_of_poses(60, 0.1);
  const Seconds seconds = optimizer_->optimize(graph).seconds;
  double sum = 0.0;
  for (const double part :
       {seconds.linearize, seconds.analyze, seconds.factorize, seconds.solve, seconds.update}) {
    EXPECT_GE(part, 0.0);
    sum += part;
  }
  EXPECT_GT(sum, 0.0);
  EXPECT_LE(sum, seconds.total * (1.0 + 1e-9));
}

TEST(GaussNewton, SaysThatItDivergesAndKeepsTheBestEstimate) {
  Registry registry;
  if (!registry.has("optimizer", "gauss_newton") || !registry.has("linear_solver", "eigen"))
    GTEST_SKIP();
  const auto optimizer = registry.make<Optimizer>("gauss_newton:rises=2,linear_solver=eigen");
  Graph graph = overshooting(3.0);
  const Summary summary = optimizer->optimize(graph);
  EXPECT_EQ(summary.status, Status::diverged);
  EXPECT_THAT(summary.notes, Contains(HasSubstr("diverged")));
  double lowest = summary.initial_chi2;
  for (const Iteration& iteration : summary.iterations) lowest = std::min(lowest, iteration.chi2);
  EXPECT_LT(lowest, summary.iterations.back().chi2);
  EXPECT_EQ(summary.final_chi2, lowest);
  EXPECT_EQ(chi2_of(graph), lowest);
}

/// All of Ceres' directions with all line searches that it accepts for them.
std::vector<std::string> line_searches() {
  const std::string name = "ceres_line_search";
  if (!Registry().has("optimizer", name)) return {};
  std::vector<std::string> specs;
  for (const char* direction : {"lbfgs", "bfgs", "steepest_descent"})
    specs.push_back(name + ":direction=" + direction);
  for (const char* formula : {"fletcher_reeves", "polak_ribiere", "hestenes_stiefel"}) {
    specs.push_back(name + ":direction=nonlinear_conjugate_gradient,conjugate_gradient=" + formula);
  }
  for (const char* direction : {"nonlinear_conjugate_gradient", "steepest_descent"})
    specs.push_back(name + ":line_search=armijo,direction=" + direction);
  return specs;
}

class CeresLineSearch : public testing::TestWithParam<std::string> {
 protected:
  Registry registry_;
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(CeresLineSearch);
INSTANTIATE_TEST_SUITE_P(Registered, CeresLineSearch, testing::ValuesIn(line_searches()),
                         test_name);

TEST_P(CeresLineSearch, FindsTheMinimumInEnoughIterations) {
  const auto optimizer = registry_.make<Optimizer>(GetParam());
  for (Graph& graph : std::array{ring_of_poses(12, 0.1), poses_and_points(8, 0.05)}) {
    const double expected = dense_minimum(graph);
    const Summary summary = optimizer->optimize(graph, Stop{.max_iterations = 20000});
    EXPECT_EQ(summary.status, Status::converged);
    EXPECT_NEAR(summary.final_chi2, expected, 1e-9 * expected);
  }
}

TEST_P(CeresLineSearch, HasConvergedOnlyAtTheMinimum) {
  const auto optimizer = registry_.make<Optimizer>(GetParam());
  const double expected = dense_minimum(ring_of_poses(40, 0.1));
  for (const int iterations : {1, 5, 20, 60, 150, 400}) {
    Graph graph = ring_of_poses(40, 0.1);
    const Summary summary = optimizer->optimize(graph, Stop{.max_iterations = iterations});
    const bool there = summary.final_chi2 <= expected * (1.0 + 1e-9);
    EXPECT_TRUE(there || summary.status == Status::max_iterations) << iterations;
    EXPECT_LE(summary.iterations.size(), static_cast<std::size_t>(iterations));
    EXPECT_LE(summary.final_chi2, summary.initial_chi2);
  }
}

TEST_P(CeresLineSearch, HasConvergedWhereTheGradientIsZero) {
  const auto optimizer = registry_.make<Optimizer>(GetParam());
  Graph graph;
  const auto pose = registry_.variable_type("VERTEX_SE2");
  const std::array<double, 3> here{0.0, 0.0, 0.0}, there{1.0, 0.0, 0.0};
  const std::array<double, 6> information{1.0, 0.0, 0.0, 1.0, 0.0, 1.0};
  const std::array<int, 2> on{graph.add_variable(pose, 0, here),
                              graph.add_variable(pose, 1, there)};
  graph.add_factor(registry_.factor_type("EDGE_SE2"), on, there, information);
  const Summary summary = optimizer->optimize(graph);
  EXPECT_EQ(summary.status, Status::converged);
  EXPECT_EQ(summary.initial_chi2, 0.0);
  EXPECT_EQ(summary.final_chi2, 0.0);
}

TEST(CeresLineSearchOptions, AreRefusedWhereTheyDoNotGoTogether) {
  CAIRN_NEEDS("optimizer", "ceres_line_search");
  Registry registry;
  EXPECT_THROW(registry.make<Optimizer>("ceres_line_search:line_search=armijo"), Error);
  Graph graph = ring_of_poses(40, 0.1);
  const auto bfgs = registry.make<Optimizer>("ceres_line_search:direction=bfgs,max_size=100");
  try {
    bfgs->optimize(graph);
    ADD_FAILURE() << "it was accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("117 × 117, more than max_size=100"));
  }
}

TEST(SummaryStatus, HasTheNamesOfTheCommandLine) {
  EXPECT_EQ(to_string(Status::converged), "converged");
  EXPECT_EQ(to_string(Status::max_iterations), "max_iterations");
  EXPECT_EQ(to_string(Status::diverged), "diverged");
  EXPECT_EQ(to_string(Status::not_positive_definite), "not_positive_definite");
  EXPECT_EQ(to_string(Status::interrupted), "interrupted");
}

}  // namespace
}  // namespace cairn::test
