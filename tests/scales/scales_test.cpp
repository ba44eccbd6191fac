// SPDX-License-Identifier: BSD-3-Clause
// The same graphs in other numbers: a small part of what ./dev scales tries, and all that is no
// optimizer: initial guesses, estimators, covariances.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/graph/factors_by_variable.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "trial.hpp"

namespace cairn::scales {
namespace {

Problem named(const std::string& name) {
  for (Problem& problem : all_problems()) {
    if (problem.name == name) return std::move(problem);
  }
  throw std::invalid_argument("there is no problem " + name);
}

TEST(Scales, ThereAre32DifferentGraphs) {
  std::vector<std::string> names;
  for (const Problem& problem : all_problems()) names.push_back(problem.name);
  std::ranges::sort(names);
  EXPECT_EQ(names.size(), 32u);
  EXPECT_EQ(std::ranges::adjacent_find(names), names.end());
}

TEST(Scales, AChangeKeepsTheProblem) {
  Registry registry;
  for (const Problem& problem : few_problems()) {
    const Graph plain = make_graph(problem, registry);
    for (const Change& change : all_changes()) {
      Graph changed = plain.clone();
      apply(change, changed);
      EXPECT_NEAR(chi2(changed) / change.information, chi2(plain),
                  1e-9 * chi2(plain) + 10.0 * rounding_of_chi2(change, plain))
          << problem.name << ", " << change.name;
      const std::vector<double> x = undone(change, changed, 1);
      for (std::size_t k = 0; k < x.size(); ++k)
        EXPECT_NEAR(x[k], plain.state(1)[k], 1e-12 + 1e-15 * change.largest_offset());
    }
  }
}

TEST(Scales, AnotherEstimateIsWrongAndAnyOtherStatusIsHonest) {
  Registry registry;
  const Problem problem = named("ring-30");
  const Reference reference = solve_reference(problem, registry);
  Summary summary;
  summary.status = Status::converged;
  summary.final_chi2 = reference.chi2;
  const Change plain;
  Graph graph = reference.graph.clone();
  EXPECT_EQ(judge(reference, plain, graph, summary).verdict, Verdict::same);
  summary.final_chi2 *= 1.0 + 1e-5;
  EXPECT_EQ(judge(reference, plain, graph, summary).verdict, Verdict::wrong);
  summary.final_chi2 = reference.chi2;

  std::vector<double> x(graph.state(7).begin(), graph.state(7).end());
  x[0] += 2e-6 * reference.size;
  graph.set_state(7, x);
  EXPECT_EQ(judge(reference, plain, graph, summary).verdict, Verdict::wrong);
  summary.status = Status::max_iterations;
  EXPECT_EQ(judge(reference, plain, graph, summary).verdict, Verdict::honest);
}

/// Solves these problems after these changes with every optimizer and linear solver.
void expect_nothing_wrong(const std::vector<Problem>& problems, Registry& registry) {
  for (const Problem& problem : problems) {
    const Reference reference = solve_reference(problem, registry);
    for (const Change& change : few_changes()) {
      const Graph start = changed_problem(problem, change, registry);
      int same = 0;
      for (const Method& method : few_methods()) {
        // On whole graphs they need minutes; the smallest shows what they do.
        const bool relaxation = method.linear_solver.find("max_iterations") != std::string::npos;
        if (relaxation && problem.name != "ring-30") continue;
        const Outcome outcome = try_out(reference, change, start, *method.make(registry));
        EXPECT_NE(outcome.verdict, Verdict::wrong) << problem.name << ", " << change.name << ", "
                                                   << method.spec() << ": " << outcome.words;
        same += outcome.verdict == Verdict::same;
      }
      EXPECT_GT(same, 0) << problem.name << ", " << change.name;
    }
  }
}

TEST(Scales, NoOptimizerConvergesToAnotherEstimate) {
  Registry registry;
  expect_nothing_wrong(few_problems(), registry);
}

/// All poses moved by `motion` from the left.
Graph moved(const Graph& graph, std::span<const double> motion) {
  Graph result = graph.clone();
  for (int v = 0; v < graph.variable_count(); ++v) {
    std::vector<double> x(motion.size());
    graph.type(v).lie_group()->compose(motion.data(), graph.state(v).data(), x.data());
    result.set_state(v, x);
  }
  return result;
}

/// Relative measurements only: wherever the world is turned to, headings pass ±π elsewhere.
void expect_same_wherever_turned(const std::string& name, const std::vector<double>& motion) {
  Registry registry;
  const Reference reference = solve_reference(named(name), registry);
  const Graph turned = moved(reference.graph, motion);
  const Graph start = moved(make_graph(named(name), registry), motion);
  for (const std::string& optimizer : registry.names(Optimizer::kKind)) {
    Graph graph = start.clone();
    const Summary summary = registry.make<Optimizer>(optimizer)->optimize(
        graph, {.max_iterations = 5000, .tolerance = 1e-14});
    EXPECT_EQ(summary.status, Status::converged) << optimizer;
    EXPECT_NEAR(summary.final_chi2, reference.chi2, 1e-8 * reference.chi2) << optimizer;
    const Reference wanted{turned.clone(), reference.chi2, reference.size};
    EXPECT_LT(deviation(wanted, {}, graph), 1e-6) << optimizer;
  }
}

TEST(Scales, HalfTurnsOfTheWorldChangeNothing) {
  for (const double turn : {std::numbers::pi, -std::numbers::pi, 0.5 * std::numbers::pi})
    expect_same_wherever_turned("ring-30", {0.0, 0.0, turn});
  for (const std::vector<double>& motion : {std::vector<double>{0, 0, 0, 1, 0, 0, 0},
                                            {0, 0, 0, 0, -1, 0, 0},
                                            {0, 0, 0, 0, 0, 1, 0},
                                            {0, 0, 0, 0.6, 0.0, -0.8, 0}})
    expect_same_wherever_turned("sphere-40", motion);
}

class EveryGuess : public testing::TestWithParam<std::string> {};

/// Their thresholds are those of chi2 or of angles, and so the same guess comes out. `auto` chooses
/// by whether chi2 is plausible, which the information's scale decides: that is its meaning.
TEST_P(EveryGuess, IsTheSameAtAnyScale) {
  Registry registry;
  for (const std::string name : {"ring-30", "landmarks-40", "sphere-40", "grid-64-priors"}) {
    Graph plain = make_graph(named(name), registry);
    Reference reference{plain.clone(), 0.0, 100.0};
    registry.make<InitialGuess>(GetParam())->compute(reference.graph);
    for (const Change& change : all_changes()) {
      Graph changed = plain.clone();
      apply(change, changed);
      registry.make<InitialGuess>(GetParam())->compute(changed);
      EXPECT_LT(deviation(reference, change, changed), 1e-6 + 1e-13 * change.largest_offset())
          << name << ", " << change.name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scales, EveryGuess,
                         testing::Values("as_given", "odometry", "spanning_tree", "chordal",
                                         "incremental"));

/// The graph, variable by variable, at the estimator's own guess.
void feed(const Graph& graph, Estimator& estimator) {
  const FactorsByVariable factors(graph);
  for (int v = 0; v < graph.variable_count(); ++v) {
    GraphUpdate update;
    update.variables.push_back(graph.variable(v));
    for (const int f : factors[v]) {
      const auto on = graph.factor_variables(f);
      if (std::ranges::max(on) == v) update.factors.push_back(graph.factor(f));
    }
    estimator.update(update);
  }
  estimator.update({}, {.full = true});
}

std::vector<double> covariance_of_last(const Graph& graph, Estimator& estimator) {
  const int last = graph.variable_count() - 1;
  const auto n = static_cast<std::size_t>(graph.type(last).tangent_size());
  std::vector<double> block(n * n);
  EXPECT_TRUE(estimator.covariance(graph.id(last), graph.id(last), block));
  return block;
}

/// All changes, after the graph as it is.
std::vector<Change> changes_after_none() {
  std::vector<Change> changes = all_changes();
  std::stable_partition(changes.begin(), changes.end(),
                        [](const Change& change) { return change.name == "as it is"; });
  return changes;
}

/// What an element of a covariance block is multiplied by.
double unit_of(const Change& change, const VariableType& type, std::size_t row,
               std::size_t column) {
  const Lengths lengths = lengths_of_tangent(type);
  const auto is_length = [&](std::size_t k) {
    return static_cast<int>(k) >= lengths.begin &&
           static_cast<int>(k) < lengths.begin + lengths.count;
  };
  return std::pow(change.length, is_length(row) + is_length(column)) / change.information;
}

void expect_same_covariance(const Change& change, const VariableType& type,
                            std::span<const double> found, std::span<const double> wanted) {
  const auto n = static_cast<std::size_t>(type.tangent_size());
  for (std::size_t row = 0; row < n; ++row) {
    for (std::size_t column = 0; column < n; ++column) {
      const double size = std::sqrt(wanted[row * n + row] * wanted[column * n + column]);
      EXPECT_NEAR(found[column * n + row] / unit_of(change, type, row, column),
                  wanted[column * n + row], 1e-6 * size + 1e-300)
          << change.name << ": " << row << ", " << column;
    }
  }
}

class EveryEstimator : public testing::TestWithParam<std::string> {};

TEST_P(EveryEstimator, FindsTheSameEstimateAndCovarianceAtAnyScale) {
  Registry registry;
  for (const std::string name : {"ring-30", "sphere-40"}) {
    const Problem problem = named(name);
    const Reference reference = solve_reference(problem, registry);
    std::vector<double> wanted;
    for (const Change& change : changes_after_none()) {
      Graph graph = make_graph(problem, registry);
      apply(change, graph);
      const auto estimator = registry.make<Estimator>(GetParam());
      feed(graph, *estimator);
      EXPECT_LT(deviation(reference, change, estimator->graph()), 1e-5)
          << name << ", " << change.name;
      EXPECT_NEAR(estimator->chi2() / change.information, reference.chi2,
                  1e-6 * reference.chi2 + 10.0 * rounding_of_chi2(change, reference.graph));
      const std::vector<double> found = covariance_of_last(graph, *estimator);
      if (wanted.empty()) wanted = found;
      expect_same_covariance(change, graph.type(graph.variable_count() - 1), found, wanted);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scales, EveryEstimator,
                         testing::Values("incremental_cholesky", "batch", "periodic_batch",
                                         "incremental_qr"));

TEST(Scales, CovariancesScaleWithTheInformation) {
  Registry registry;
  const Reference reference = solve_reference(named("sphere-40"), registry);
  for (const std::string& name : registry.names(LinearSolver::kKind)) {
    const auto solver = registry.make<LinearSolver>(name);
    if (!query<Marginals>(*solver)) continue;
    std::vector<double> wanted;
    for (const Change& change : changes_after_none()) {
      Graph graph = reference.graph.clone();
      apply(change, graph);
      GraphMarginals marginals(graph, *solver);
      ASSERT_TRUE(marginals.factorize().ok) << name << ", " << change.name;
      const std::vector<double> found = marginals.diagonal();
      if (wanted.empty()) wanted = found;
      for (std::size_t block = 36; block < found.size(); block += 36 * 7) {
        expect_same_covariance(change, graph.type(1), std::span(found).subspan(block, 36),
                               std::span(wanted).subspan(block, 36));
      }
    }
  }
}

}  // namespace
}  // namespace cairn::scales
