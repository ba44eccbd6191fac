// SPDX-License-Identifier: BSD-3-Clause
#include "trial.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "support/components.hpp"

namespace cairn::scales {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Stop kStop{.max_iterations = 100, .tolerance = 1e-15};
constexpr int kMostSweeps = 500;
/// An estimate may be off by more than `kTolerance`, but not by more than this, if chi2 does not
/// show it because it is a sum of rounded numbers, or coordinates are rounded noticeably.
constexpr double kUnseenTolerance = 1e-5, kRoundedTolerance = 1e-3;
constexpr double kChi2Rounding = 1e-12;
/// chi2 of a graph that fits exactly is the rounding of its residuals.
constexpr double kExact = 1e-12;

/// The loss turns robust at a whitened norm, which grows with the root of the information.
void set_loss(const Problem& problem, const Change& change, Graph& graph, Registry& registry) {
  if (problem.loss.empty()) return;
  const double width = problem.width * std::sqrt(change.information);
  graph.set_loss(registry.make<Loss>(ComponentSpec{problem.loss, {{"scale", option_text(width)}}}));
}

std::vector<std::array<double, 3>> positions(const Graph& graph, const Change& change) {
  std::vector<std::array<double, 3>> all;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const Placement* placement = graph.type(v).placement();
    if (!placement) continue;
    std::array<double, 9> R{};
    placement->split(undone(change, graph, v).data(), R.data(), all.emplace_back().data());
  }
  return all;
}

double distance(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

double size_of(const std::vector<std::array<double, 3>>& all) {
  std::array<double, 3> low = all.front(), high = all.front();
  for (const auto& p : all) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], p[k]);
      high[k] = std::max(high[k], p[k]);
    }
  }
  return distance(low, high);
}

/// Distances of all positions from the first, and from the one before, as a share of their mean:
/// what neither a motion nor a scale changes.
std::vector<double> shape(const std::vector<std::array<double, 3>>& all) {
  std::vector<double> distances;
  double sum = 0.0;
  for (std::size_t k = 1; k < all.size(); ++k) {
    distances.push_back(distance(all[0], all[k]));
    distances.push_back(distance(all[k - 1], all[k]));
    sum += distances.back();
  }
  for (double& each : distances) each *= static_cast<double>(all.size() - 1) / sum;
  return distances;
}

/// The larger one, or infinity where one is not a number.
double worse(double a, double b) {
  return std::isnan(a) || std::isnan(b) ? kInfinity : std::max(a, b);
}

double deviation_of_shape(const Reference& reference, const Change& change, const Graph& graph) {
  const std::vector<double> wanted = shape(positions(reference.graph, {}));
  const std::vector<double> found = shape(positions(graph, change));
  double largest = 0.0;
  for (std::size_t k = 0; k < wanted.size(); ++k)
    largest = worse(largest, std::abs(found[k] - wanted[k]));
  return largest;
}

double deviation_of_variable(const Reference& reference, const Change& change, const Graph& graph,
                             int v) {
  const VariableType& type = graph.type(v);
  const std::vector<double> x = undone(change, graph, v);
  std::vector<double> delta(static_cast<std::size_t>(type.tangent_size()));
  type.local(1, reference.graph.state(v).data(), x.data(), delta.data());
  const Lengths lengths = lengths_of_tangent(type);
  double largest = 0.0;
  for (int k = 0; k < type.tangent_size(); ++k) {
    const bool length = k >= lengths.begin && k < lengths.begin + lengths.count;
    const bool focal = k == 0 && lengths.begin > 0;
    const double unit = length  ? reference.size
                        : focal ? std::abs(reference.graph.state(v)[0])
                                : 1.0;
    largest = worse(largest, std::abs(delta[k]) / unit);
  }
  return largest;
}

/// Whether chi2 of the estimate, taken where its coordinates are not rounded, is above that of the
/// reference by less than their rounding moves it, factor by factor and at random: no method that
/// compares chi2 could tell the two apart.
bool as_near_as_rounding_allows(const Reference& reference, const Change& change,
                                const Graph& graph, double off) {
  const bool rounded = change.largest_offset() > 0.0;
  if (reference.free || !(off <= (rounded ? kRoundedTolerance : kUnseenTolerance))) return false;
  const double rounding =
      kChi2Rounding * reference.chi2 + rounding_of_chi2(change, reference.graph);
  Graph exact = reference.graph.clone();
  for (int v = 0; v < graph.variable_count(); ++v) exact.set_state(v, undone(change, graph, v));
  return std::abs(chi2(exact) - reference.chi2) <= rounding;
}

void guess(Graph& graph, Registry& registry) {
  registry.make<InitialGuess>("auto")->compute(graph);
}

/// A relaxation that may sweep for as long as it likes takes hours on badly conditioned graphs, and
/// fails all the same.
std::string with_limit(const std::string& linear_solver, Registry& registry) {
  const OptionSpec* limit =
      registry.options(LinearSolver::kKind, parse_component(linear_solver).name)
          .find("max_iterations");
  if (!limit || limit->default_value != "0") return linear_solver;
  const char separator = linear_solver.find(':') == std::string::npos ? ':' : ',';
  return linear_solver + separator + "max_iterations=" + std::to_string(kMostSweeps);
}

std::vector<Method> combined(const std::vector<std::string>& optimizers,
                             const std::vector<std::string>& linear_solvers) {
  Registry registry;
  std::vector<Method> methods;
  for (const std::string& optimizer : optimizers) {
    const OptionSpec* option =
        registry.options(Optimizer::kKind, parse_component(optimizer).name).find("linear_solver");
    if (!option || option->type != OptionType::component) {
      methods.push_back({optimizer, ""});
      continue;
    }
    for (const std::string& solver : linear_solvers)
      methods.push_back({optimizer, with_limit(solver, registry)});
  }
  return methods;
}

}  // namespace

std::string Method::spec() const {
  return linear_solver.empty() ? optimizer : optimizer + ", " + linear_solver;
}

std::unique_ptr<Optimizer> Method::make(Registry& registry) const {
  ComponentSpec spec = parse_component(optimizer);
  if (!linear_solver.empty()) spec.values["linear_solver"] = linear_solver;
  return registry.make<Optimizer>(spec);
}

std::vector<Method> all_methods() {
  return combined(test::every_component(Optimizer::kKind),
                  test::every_component(LinearSolver::kKind));
}

std::vector<Method> few_methods() {
  const auto plain = [](std::vector<std::string> specs) {
    std::erase_if(specs,
                  [](const std::string& spec) { return spec.find(':') != std::string::npos; });
    return specs;
  };
  return combined(plain(test::every_component(Optimizer::kKind)),
                  plain(test::every_component(LinearSolver::kKind)));
}

Reference solve_reference(const Problem& problem, Registry& registry) {
  Reference reference{make_graph(problem, registry)};
  set_loss(problem, {}, reference.graph, registry);
  guess(reference.graph, registry);
  const auto optimizer =
      registry.make<Optimizer>(test::with_some_linear_solver("levenberg_marquardt"));
  optimizer->optimize(reference.graph, {.max_iterations = 1000, .tolerance = 1e-16});
  reference.chi2 = chi2(reference.graph);
  reference.size = size_of(positions(reference.graph, {}));
  reference.free = !resolve_gauge(reference.graph).left_free.empty();
  return reference;
}

Graph changed_problem(const Problem& problem, const Change& change, Registry& registry) {
  Graph graph = make_graph(problem, registry);
  apply(change, graph);
  set_loss(problem, change, graph, registry);
  guess(graph, registry);
  return graph;
}

double deviation(const Reference& reference, const Change& change, const Graph& graph) {
  if (reference.free) return deviation_of_shape(reference, change, graph);
  double largest = 0.0;
  for (int v = 0; v < graph.variable_count(); ++v)
    largest = worse(largest, deviation_of_variable(reference, change, graph, v));
  return largest;
}

Outcome judge(const Reference& reference, const Change& change, const Graph& graph,
              const Summary& summary) {
  const double off = deviation(reference, change, graph);
  const double difference = std::abs(summary.final_chi2 / change.information - reference.chi2);
  const double allowed = kTolerance * reference.chi2 +
                         kExact * static_cast<double>(graph.residual_size()) +
                         rounding_of_chi2(change, graph);
  // Both are false for what is not a number.
  const bool near = off <= kTolerance || as_near_as_rounding_allows(reference, change, graph, off);
  const bool same = near && difference <= allowed;
  Outcome outcome;
  outcome.words = fmt::format("{} after {}: estimate off by {:.1e}, chi2 by {:.1e} of {:.3e}",
                              to_string(summary.status), summary.iterations.size(), off, difference,
                              reference.chi2);
  for (const std::string& note : summary.notes) outcome.words += "; " + note;
  if (summary.status == Status::converged) outcome.verdict = same ? Verdict::same : Verdict::wrong;
  return outcome;
}

Outcome try_out(const Reference& reference, const Change& change, const Graph& start,
                Optimizer& optimizer) {
  Graph graph = start.clone();
  Observer silent;
  try {
    const Summary summary = optimizer.optimize(graph, kStop, silent);
    return judge(reference, change, graph, summary);
  } catch (const Error& error) {
    return {Verdict::honest, error.what()};
  }
}

}  // namespace cairn::scales
