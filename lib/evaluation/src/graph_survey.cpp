// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/graph_survey.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/fixed_variables.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/undetermined.hpp"
#include "cairn/geometry/pose.hpp"

namespace cairn {
namespace {

constexpr std::size_t kWorst = 5;
// chi2 of a good model and estimate is near its degrees of freedom; beyond these ratios it is worth
// a word.
constexpr double kLargeRatio = 100.0, kSmallRatio = 0.01;

/// "1 factor", "2 factors"
std::string counted(std::int64_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

void count_variables(const Graph& graph, GraphSurvey& s) {
  for (const VariablePool& pool : graph.variable_pools()) {
    GraphSurvey::VariableCount& count = s.variables.emplace_back();
    count.tag = pool.type->tag();
    count.count = std::ssize(pool.variables);
    count.tangent_size = pool.type->tangent_size();
    for (const int variable : pool.variables) count.fixed += graph.fixed(variable);
  }
}

void count_factors(const Graph& graph, const std::vector<double>& norms, GraphSurvey& s) {
  for (const FactorPool& pool : graph.factor_pools()) {
    GraphSurvey::FactorCount& count = s.factors.emplace_back();
    count.tag = pool.type->tag();
    count.count = std::ssize(pool.sequence);
    count.residual_size = pool.type->residual_size();
    count.metric = pool.type->metric();
    for (const int position : pool.sequence) count.chi2 += norms[position];
  }
  s.chi2 = std::accumulate(norms.begin(), norms.end(), 0.0);
}

/// Relative factors as pairs of variables, the smaller first.
std::vector<std::pair<int, int>> relative_pairs(const Graph& graph) {
  std::vector<std::pair<int, int>> pairs;
  for (const FactorPool& pool : graph.factor_pools()) {
    if (!pool.type->is_relative()) continue;
    for (std::size_t k = 0; k + 1 < pool.variables.size(); k += 2) {
      pairs.push_back(std::minmax<int>(pool.variables[k], pool.variables[k + 1]));
    }
  }
  return pairs;
}

void count_odometry_and_loops(const Graph& graph, GraphSurvey& s) {
  const std::vector<bool> loop = loop_closures(graph);
  for (const FactorPool& pool : graph.factor_pools()) {
    if (!pool.type->is_relative()) continue;
    for (const int position : pool.sequence) ++(loop[position] ? s.loops : s.odometry);
  }
}

/// Poses: what relative factors join. Walks each type by id and counts where the chain is broken.
void count_chain_gaps(const Graph& graph, GraphSurvey& s) {
  const auto pairs = relative_pairs(graph);
  const std::set<std::pair<int, int>> joined(pairs.begin(), pairs.end());
  std::map<int, std::vector<std::pair<Id, int>>> by_pool;  // pool → (id, variable)
  std::set<int> poses;
  for (const auto& [a, b] : joined) poses.insert({a, b});
  for (const int v : poses) by_pool[graph.pool(v)].emplace_back(graph.id(v), v);
  for (auto& [pool, chain] : by_pool) {
    std::sort(chain.begin(), chain.end());
    for (std::size_t k = 1; k < chain.size(); ++k) {
      s.chain_gaps += !joined.contains(std::minmax(chain[k - 1].second, chain[k].second));
    }
  }
}

void count_doubled(const Graph& graph, GraphSurvey& s) {
  std::set<std::vector<int>> seen;  // pool and sorted variables
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto variables = graph.factor_variables(f);
    if (variables.size() < 2) continue;
    std::vector<int> key(variables.begin(), variables.end());
    std::sort(key.begin(), key.end());
    key.push_back(graph.ref(f).pool);
    s.doubled += !seen.insert(std::move(key)).second;
  }
}

void find_worst(const Graph& graph, const std::vector<double>& norms, GraphSurvey& s) {
  std::vector<int> order(norms.size());
  std::iota(order.begin(), order.end(), 0);
  const std::size_t count = std::min(kWorst, order.size());
  std::partial_sort(
      order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
      [&](int a, int b) { return norms[a] != norms[b] ? norms[a] > norms[b] : a < b; });
  for (std::size_t k = 0; k < count; ++k) {
    s.worst.push_back({graph.describe_factor(order[k]), norms[order[k]]});
  }
}

void count_freedoms(const Graph& graph, GraphSurvey& s) {
  s.gauge = resolve_gauge(graph);
  for (const int v : s.gauge.anchored) s.gauge_freedoms += graph.type(v).tangent_size();
  s.degrees_of_freedom = degrees_of_freedom(graph, s.gauge);
}

void suspect_structure(const Graph& graph, GraphSurvey& s) {
  const auto say = [&](std::string sentence) { s.suspicions.push_back(std::move(sentence)); };
  if (graph.factor_count() == 0) {
    say("there are no factors: nothing to optimise");
    return;
  }
  if (!s.gauge.unconstrained.empty()) {
    say(fmt::format("{} without any factor; the first is {}",
                    counted(std::ssize(s.gauge.unconstrained), "variable"),
                    graph.describe_variable(s.gauge.unconstrained.front())));
  }
  const auto parts = s.gauge.components - std::ssize(s.gauge.unconstrained);
  if (parts > 1) {
    say(fmt::format("{} parts that no factor joins: their relative poses are not determined",
                    parts));
  }
  if (std::string fixed = contradicting_fixed_variables(graph); !fixed.empty())
    say(std::move(fixed));
  if (s.doubled > 0) {
    say(fmt::format("{} on variables that another of the type joins already (doubled edges)",
                    counted(s.doubled, "factor")));
  }
  if (s.chain_gaps > 0) {
    say(fmt::format("the odometry chain has {}: consecutive poses that no factor joins",
                    counted(s.chain_gaps, "gap")));
  }
}

constexpr std::string_view kOrientation = "EDGE_SE3_PRIORQUAT";

/// How many of the three numbers of an orientation in space a prior on a pose, or on its
/// orientation alone, measures; none where it is another kind of factor.
int turns_measured(const Graph& graph, int position) {
  const FactorType& type = graph.factor_type(position);
  constexpr int kPose = 6, kTurns = 3;
  if (type.arity() != 1 || (type.residual_size() != kPose && type.tag() != kOrientation)) return 0;
  const VariableType& pose = graph.type(graph.factor_variables(position)[0]);
  if (pose.tangent_size() != kPose || !has_orientation(pose) ||
      pose.placement()->dimension() != kTurns)
    return 0;
  // The last rows of the triangular root are what the rotation has beside the translation.
  const std::span<const double> root = graph.sqrt_information(position);
  std::size_t row = root.size();
  int measured = 0;
  for (int k = 0; k < kTurns; ++k) {
    row -= static_cast<std::size_t>(k + 1);
    measured += root[row] > 0.0;
  }
  return measured;
}

void suspect_parts_of_rotations(const Graph& graph, GraphSurvey& s) {
  std::int64_t count = 0;
  int first = -1;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const int measured = turns_measured(graph, f);
    if (measured == 0 || measured == 3) continue;
    if (count++ == 0) first = f;
  }
  if (count == 0) return;
  s.suspicions.push_back(fmt::format(
      "{} a part of an orientation in space (first: {}): what it weighs depends on the part that "
      "is "
      "not measured; a direction, such as that of gravity for roll and pitch, is EDGE_SE3_PRIORVEC",
      count == 1 ? "1 prior measures" : fmt::format("{} priors measure", count),
      graph.describe_factor(first)));
}

void suspect_numbers(GraphSurvey& s) {
  const auto say = [&](std::string sentence) { s.suspicions.push_back(std::move(sentence)); };
  const auto dof = static_cast<double>(s.degrees_of_freedom);
  if (dof < 0) {
    say(fmt::format("{} more unknowns than measurements: the estimate is not determined",
                    -s.degrees_of_freedom));
  } else if (dof > 0 && s.chi2 > kLargeRatio * dof) {
    say(fmt::format(
        "chi2 is {:.3g} times the degrees of freedom: the estimate is far from the "
        "measurements (optimise first), or the information is too large (units? degrees?)",
        s.chi2 / dof));
  } else if (dof > 0 && s.chi2 < kSmallRatio * dof) {
    say(fmt::format(
        "chi2 is only {:.3g} times the degrees of freedom: the information is too small, "
        "or the measurements have no noise",
        s.chi2 / dof));
  }
  if (!s.worst.empty() && s.worst.size() == kWorst && s.chi2 > 0) {
    double share = 0.0;
    for (const GraphSurvey::WorstFactor& factor : s.worst) share += factor.chi2 / s.chi2;
    std::int64_t factors = 0;
    for (const GraphSurvey::FactorCount& count : s.factors) factors += count.count;
    if (factors >= 100 && share > 0.5) {
      say(fmt::format("the {} worst of {} factors make {:.0f} % of chi2: outliers?", kWorst,
                      factors, 100 * share));
    }
  }
}

}  // namespace

GraphSurvey survey_graph(const Graph& graph) {
  GraphSurvey s;
  const std::vector<double> norms = squared_norms(graph);
  count_variables(graph, s);
  count_factors(graph, norms, s);
  count_odometry_and_loops(graph, s);
  count_chain_gaps(graph, s);
  count_doubled(graph, s);
  count_freedoms(graph, s);
  find_worst(graph, norms, s);
  suspect_structure(graph, s);
  suspect_parts_of_rotations(graph, s);
  const std::size_t before = s.suspicions.size();
  note_what_is_free(graph, s.suspicions);
  // Where an optimisation ends, other directions may be free.
  if (s.suspicions.size() > before) s.suspicions.back() += " (at the states given)";
  suspect_numbers(s);
  return s;
}

}  // namespace cairn
