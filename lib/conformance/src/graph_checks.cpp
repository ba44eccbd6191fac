// SPDX-License-Identifier: BSD-3-Clause
// What optimizers, estimators and initial guesses do on a small pose graph, against Gauss-Newton
// with dense algebra.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "checker.hpp"
#include "sample_graph.hpp"
#include "samples.hpp"

namespace cairn::conformance {
namespace {

constexpr int kPoses = 40;
constexpr double kMinimum = 1e-4;  // share of chi2 by which an optimizer may end above the minimum
constexpr double kFilter = 0.05;   // the same of an estimator, which may linearise each factor once

bool all_finite(const Graph& graph) {
  for (int v = 0; v < graph.variable_count(); ++v) {
    for (const double x : graph.state(v)) {
      if (!std::isfinite(x)) return false;
    }
  }
  return true;
}

std::string of_graph(const Graph& graph) {
  return fmt::format("{} poses on two laps, {} relative poses", graph.variable_count(),
                     graph.factor_count());
}

// Optimizers
// ----------------------------------------------------------------------------------------

void check_minimum(const Subject& subject, Checker& check) {
  for (std::uint64_t k = 0; k < 3; ++k) {
    Graph graph = two_laps(kPoses, check.options().seed + k);
    if (k == 1) graph.set_fixed(3);
    Graph reference = graph.clone();
    check.sample(of_graph(graph) + (k == 1 ? ", pose 3 fixed" : ""), [&] {
      const double least = minimize_densely(reference);
      const auto optimizer = subject.registry.make<Optimizer>(subject.name);
      const std::vector<double> fixed(graph.state(3).begin(), graph.state(3).end());
      const double before = chi2(graph);
      const Summary summary = check.call(
          "optimize", [&] { return optimizer->optimize(graph, {.max_iterations = 2000}); });
      const double after = chi2(graph);
      check.expect(after <= least * (1.0 + kMinimum), "chi2 reaches the minimum", [&] {
        return fmt::format("{} ({}), where dense Gauss-Newton reaches {}", after,
                           to_string(summary.status), least);
      });
      check.expect(std::abs(summary.final_chi2 - after) <= 1e-9 * (1.0 + after),
                   "final_chi2 is that of the states left in the graph",
                   [&] { return fmt::format("{} and {}", summary.final_chi2, after); });
      check.expect(std::abs(summary.initial_chi2 - before) <= 1e-9 * (1.0 + before),
                   "initial_chi2 is that of the states given",
                   [&] { return fmt::format("{} and {}", summary.initial_chi2, before); });
      check.expect(all_finite(graph), "the states are finite",
                   [] { return std::string("one is not"); });
      if (k != 1) return;
      check.expect(std::ranges::equal(fixed, graph.state(3)), "a fixed variable stays",
                   [&] { return "it moved to " + text_of(graph.state(3)); });
    });
  }
}

void check_stopping(const Subject& subject, Checker& check) {
  Graph graph = two_laps(kPoses, check.options().seed);
  check.sample(of_graph(graph) + ", one iteration", [&] {
    Graph copy = graph.clone();
    const double before = chi2(copy);
    const auto optimizer = subject.registry.make<Optimizer>(subject.name);
    const Summary summary =
        check.call("optimize", [&] { return optimizer->optimize(copy, {.max_iterations = 1}); });
    check.expect(summary.iterations.size() <= 1, "max_iterations is a limit",
                 [&] { return fmt::format("{} iterations", summary.iterations.size()); });
    check.expect(chi2(copy) <= before, "chi2 is not above that of the states given",
                 [&] { return fmt::format("{} from {}", chi2(copy), before); });
  });
  check.sample(of_graph(graph) + ", interrupted before the first iteration", [&] {
    Graph copy = graph.clone();
    const double before = chi2(copy);
    const std::atomic<bool> interrupt{true};
    const auto optimizer = subject.registry.make<Optimizer>(subject.name);
    const Summary summary = check.call("optimize", [&] {
      return optimizer->optimize(copy, {.max_iterations = 2000, .interrupt = &interrupt});
    });
    check.expect(summary.status == Status::interrupted, "an interrupt ends it", [&] {
      return fmt::format("it ended as {} after {} iterations", to_string(summary.status),
                         summary.iterations.size());
    });
    check.expect(chi2(copy) <= before, "chi2 is not above that of the states given",
                 [&] { return fmt::format("{} from {}", chi2(copy), before); });
  });
}

// Estimators
// ----------------------------------------------------------------------------------------

/// The graph in the order of its poses, each with its factors to earlier ones.
std::vector<GraphUpdate> updates_of(const Graph& graph) {
  std::vector<GraphUpdate> updates(static_cast<std::size_t>(graph.variable_count()));
  for (int v = 0; v < graph.variable_count(); ++v) {
    Variable variable = graph.variable(v);
    if (v > 0) variable.state.clear();  // the odometry gives it
    updates[static_cast<std::size_t>(v)].variables.push_back(std::move(variable));
  }
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto ends = graph.factor_variables(f);
    updates[static_cast<std::size_t>(*std::ranges::max_element(ends))].factors.push_back(
        graph.factor(f));
  }
  return updates;
}

/// The estimator after the whole graph.
std::unique_ptr<Estimator> fed(const Subject& subject, const Graph& graph, Checker& check) {
  auto estimator = subject.registry.make<Estimator>(subject.name);
  for (const GraphUpdate& update : updates_of(graph))
    check.call("update", [&] { return estimator->update(update); });
  check.call("update", [&] { return estimator->update({}, {.full = true}); });
  return estimator;
}

void check_estimate(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample(of_graph(graph) + ", pose by pose", [&] {
    Graph reference = graph.clone();
    const double least = minimize_densely(reference);
    const auto estimator = fed(subject, graph, check);
    check.expect(estimator->variable_count() == graph.variable_count() &&
                     estimator->factor_count() == graph.factor_count(),
                 "it holds all that was added", [&] {
                   return fmt::format("{} variables and {} factors", estimator->variable_count(),
                                      estimator->factor_count());
                 });
    const double found = check.call("chi2", [&] { return estimator->chi2(); });
    check.expect(found <= least * (1.0 + kFilter) + 1e-9, "chi2 is near the minimum", [&] {
      return fmt::format("{}, where dense Gauss-Newton reaches {}", found, least);
    });
    const Graph own = check.call("graph", [&] { return estimator->graph(); });
    check.expect(std::abs(chi2(own) - found) <= 1e-9 * (1.0 + found),
                 "chi2 is that of the graph that it gives",
                 [&] { return fmt::format("{} and {}", found, chi2(own)); });
    for (int v = 0; v < graph.variable_count(); ++v) {
      const std::span<const double> x =
          check.call("state", [&] { return estimator->state(graph.id(v)); });
      State delta(3);
      reference.type(v).local(1, x.data(), reference.state(v).data(), delta.data());
      check.within(norm(delta), 0.05, "states are near those of the minimum");
    }
  });
}

void check_covariances(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample(of_graph(graph) + ", pose by pose", [&] {
    const auto estimator = fed(subject, graph, check);
    Graph reference = graph.clone();
    minimize_densely(reference);
    const DenseCovariance dense = dense_covariance(reference);
    for (const int v : {1, kPoses / 2, kPoses - 1}) {
      Guarded block("block", 9);
      const bool known = check.call("covariance", {&block}, [&] {
        return estimator->covariance(graph.id(v), graph.id(v), block.span());
      });
      check.expect(known, "covariance is known", [&] { return fmt::format("not of pose {}", v); });
      const std::int64_t first = dense.first[static_cast<std::size_t>(v)];
      if (!known || first < 0) continue;
      const Eigen::MatrixXd expected = dense.Sigma.block(first, first, 3, 3);
      const std::vector<double> values = block.values();
      const Eigen::Map<const Eigen::MatrixXd> found(values.data(), 3, 3);
      check.within((found - expected).norm(), kFilter * expected.norm(),
                   "covariance is the block of H⁻¹ at the minimum");
    }
  });
}

void check_bad_updates(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample("a factor on a variable that is not there", [&] {
    const auto estimator = fed(subject, graph, check);
    const double before = estimator->chi2();
    GraphUpdate bad;
    bad.variables.push_back({graph.type_of(0), 1000, {0.0, 0.0, 0.0}});
    bad.factors.push_back(graph.factor(0));
    bad.factors.back().variables = {1000, 2000};
    const std::string outcome = check.call("update", [&]() -> std::string {
      try {
        estimator->update(bad);
        return "it was accepted";
      } catch (const Error&) {
        return "";
      }
    });
    check.expect(outcome.empty(), "update refuses an unknown id with an Error",
                 [&] { return outcome; });
    check.expect(!estimator->has(1000) && estimator->variable_count() == graph.variable_count() &&
                     estimator->chi2() == before,
                 "a refused update changes nothing", [&] {
                   return fmt::format("{} variables, chi2 {} from {}", estimator->variable_count(),
                                      estimator->chi2(), before);
                 });
  });
}

void check_copies(const Subject& subject, Checker& check) {
  const Graph graph = two_laps(kPoses, check.options().seed);
  check.sample(of_graph(graph) + ", copied", [&] {
    const auto estimator = fed(subject, graph, check);
    const double before = estimator->chi2();
    const auto copy = check.call("clone", [&] { return estimator->clone(); });
    check.expect(copy != nullptr, "clone gives a copy", [] { return std::string("it is null"); });
    if (!copy) return;
    check.expect(copy->chi2() == before, "a copy has the same chi2",
                 [&] { return fmt::format("{} and {}", copy->chi2(), before); });
    GraphUpdate more;
    more.variables.push_back({graph.type_of(0), 1000, {}});
    more.factors.push_back(graph.factor(0));
    more.factors.back().variables = {0, 1000};
    check.call("update", [&] { return copy->update(more); });
    check.expect(!estimator->has(1000) && copy->has(1000) && estimator->chi2() == before,
                 "a change of the copy is none of the original",
                 [] { return std::string("the original changed"); });
    check.call("reset", [&] { estimator->reset(); });
    check.expect(estimator->variable_count() == 0 && copy->has(1000), "reset forgets everything",
                 [&] { return fmt::format("{} variables", estimator->variable_count()); });
  });
}

// Initial guesses
// -----------------------------------------------------------------------------------

void check_guess(const Subject& subject, Checker& check) {
  Graph graph = two_laps(kPoses, check.options().seed);
  graph.set_fixed(0);
  check.sample(of_graph(graph) + ", pose 0 fixed", [&] {
    const std::vector<double> fixed(graph.state(0).begin(), graph.state(0).end());
    const int variables = graph.variable_count(), factors = graph.factor_count();
    Graph reference = graph.clone();
    const double least = minimize_densely(reference);
    const auto guess = subject.registry.make<InitialGuess>(subject.name);
    check.call("compute", [&] { return guess->compute(graph); });
    check.expect(all_finite(graph), "the states are finite",
                 [] { return std::string("one is not"); });
    check.expect(std::ranges::equal(fixed, graph.state(0)), "a fixed variable stays",
                 [&] { return "it moved to " + text_of(graph.state(0)); });
    check.expect(graph.variable_count() == variables && graph.factor_count() == factors,
                 "the graph keeps its variables and factors",
                 [] { return std::string("it does not"); });
    const double found = minimize_densely(graph);
    check.expect(found <= least * (1.0 + kMinimum), "Gauss-Newton finds the minimum from it",
                 [&] { return fmt::format("chi2 {} instead of {}", found, least); });
  });
}

}  // namespace

std::span<const Group> optimizer_groups() {
  static constexpr std::array<Group, 2> groups{
      {{"minimum", check_minimum}, {"stopping", check_stopping}}};
  return groups;
}

std::span<const Group> estimator_groups() {
  static constexpr std::array<Group, 4> groups{{{"estimate", check_estimate},
                                                {"covariances", check_covariances},
                                                {"bad updates", check_bad_updates},
                                                {"copies", check_copies}}};
  return groups;
}

std::span<const Group> initial_guess_groups() {
  static constexpr std::array<Group, 1> groups{{{"estimate", check_guess}}};
  return groups;
}

}  // namespace cairn::conformance
