// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/plausibility.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "cairn/evaluation/check_factor.hpp"
#include "cairn/evaluation/fixed_variables.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/types/domain.hpp"
#include "lower_minimum.hpp"
#include "unwrapped_angle.hpp"

namespace cairn {

std::int64_t degrees_of_freedom(const Graph& graph, const Gauge& gauge) {
  std::int64_t measured = 0, free = 0;
  for (int f = 0; f < graph.factor_count(); ++f) measured += graph.information_rank(f);
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!gauge.held[v]) free += graph.type(v).tangent_size();
  }
  return measured - free;
}

bool is_plausible(double chi2, std::int64_t degrees_of_freedom) {
  if (!std::isfinite(chi2)) return false;
  return degrees_of_freedom <= 0 || chi2 <= kImplausibleChi2 * double(degrees_of_freedom);
}

std::string implausible_estimate(const Graph& graph, double chi2) {
  const std::int64_t dof = degrees_of_freedom(graph, resolve_gauge(graph));
  if (is_plausible(chi2, dof)) return {};
  if (!std::isfinite(chi2)) return "chi2 is not finite: the estimate means nothing";
  const std::string text = fmt::format(
      "chi2 is {:.3g} times the {} degrees of freedom: this estimate is hardly the right one. ",
      chi2 / static_cast<double>(dof), dof);
  if (const std::string angle = unwrapped_angle(graph); !angle.empty()) return text + angle;
  if (const std::string fixed = contradicting_fixed_variables(graph); !fixed.empty())
    return text + fixed;
  return text +
         "Either measurements are wrong (a robust loss such as cauchy limits them), or their "
         "information is too large or in another order, or this is a local minimum (the initial "
         "guess incremental is thorough, and slow)";
}

namespace {

constexpr double kLargestDeviation = 1e-3;
constexpr double kStep = 1e-4, kLargestStep = 0.1;  // of differences
constexpr double kNoWeight = 1e-9;  // of a factor, where 1 is that of one without loss

FactorCheck check(const Graph& graph, int position) {
  std::vector<const VariableType*> types;
  std::vector<const double*> states;
  double largest = 0.0;
  for (const std::int32_t v : graph.factor_variables(position)) {
    types.push_back(&graph.type(v));
    states.push_back(graph.state(v).data());
    for (const double number : graph.state(v)) largest = std::max(largest, std::abs(number));
  }
  // Differences of states that are rounded to `rounding` are off by a part of that in the step.
  const double rounding = std::numeric_limits<double>::epsilon() * largest;
  const double step = std::max(kStep, 100.0 * rounding / kLargestDeviation);
  if (!(step <= kLargestStep)) return {.largest_deviation = std::nan("")};
  const FactorType& type = graph.factor_type(position);
  try {
    return call_plugin(
        [&] { return fmt::format("factor '{}'", type.tag()); },
        [&] { return check_factor(type, types, states, graph.measurement(position), {}, step); });
  } catch (const Error&) {  // beside the states it may not be defined
    return {.largest_deviation = std::nan("")};
  }
}

std::string in_words(const Graph& graph, int position, const FactorCheck& check) {
  const std::string factor = graph.describe_factor(position);
  if (check.column < 0) {
    return fmt::format(
        "{}: the residual differs with and without Jacobians ({:.6g} and {:.6g} in row {}): the "
        "type of the factor is wrong",
        factor, check.claimed, check.numeric, check.row);
  }
  return fmt::format(
      "{}: the Jacobian by its variable {} has {:.6g} in row {}, column {}, where differences of "
      "the "
      "residual give {:.6g}: the type of the factor is wrong",
      factor, check.variable + 1, check.claimed, check.row, check.column, check.numeric);
}

}  // namespace

std::vector<std::string> wrong_jacobians(const Graph& graph) {
  std::vector<std::string> sentences;
  for (const FactorPool& pool : graph.factor_pools()) {
    const std::size_t count = pool.sequence.size();
    if (count == 0) continue;
    // At one factor a residual may cross a cut, as a wrapped angle does.
    FactorCheck best{.largest_deviation = std::numeric_limits<double>::infinity()};
    int where = 0;
    for (const std::size_t entry : {std::size_t{0}, count / 2, count - 1}) {
      const FactorCheck found = check(graph, pool.sequence[entry]);
      if (!(found.largest_deviation < best.largest_deviation)) continue;
      best = found;
      where = pool.sequence[entry];
    }
    if (std::isfinite(best.largest_deviation) && best.largest_deviation > kLargestDeviation)
      sentences.push_back(in_words(graph, where, best));
  }
  return sentences;
}

std::string residual_not_finite(const Graph& graph) {
  const std::vector<double> norms = squared_norms(graph);
  for (int f = 0; f < graph.factor_count(); ++f) {
    if (std::isfinite(norms[f])) continue;
    return fmt::format("the residual of {} is not finite; it measures {:.6g}",
                       graph.describe_factor(f), fmt::join(graph.measurement(f), " "));
  }
  return {};
}

std::vector<std::string> outside_of_domains(const Graph& graph) {
  std::vector<std::string> sentences;
  for (std::size_t p = 0; p < graph.factor_pools().size(); ++p) {
    const FactorPool& pool = graph.factor_pools()[p];
    const auto* domain = dynamic_cast<const Domain*>(pool.type.get());
    if (!domain) continue;
    std::vector<const double*> pools;
    const FactorView view = graph.view(static_cast<int>(p), graph.values(), pools);
    std::vector<const double*> states(pools.size());
    std::vector<std::ptrdiff_t> sizes;
    for (int k = 0; k < pool.type->arity(); ++k) sizes.push_back(pool.type->ambient_size(k));
    std::map<std::string, std::pair<int, int>> reasons;  // the first factor and the number of each
    for (std::size_t entry = 0; entry < view.size; ++entry) {
      for (std::size_t k = 0; k < states.size(); ++k)
        states[k] = pools[k] + view.slots[entry * states.size() + k] * sizes[k];
      const std::string reason = domain->outside(states.data());
      if (!reason.empty())
        ++reasons.try_emplace(reason, pool.sequence[entry], 0).first->second.second;
    }
    for (const auto& [reason, found] : reasons) {
      const auto [first, count] = found;
      sentences.push_back(
          fmt::format("{}: {}{}", graph.describe_factor(first), reason,
                      count == 1 ? "" : fmt::format("; so are {} more", count - 1)));
    }
  }
  return sentences;
}

std::string losses_weigh_nothing(const Graph& graph) {
  if (!graph.has_losses() || graph.factor_count() == 0) return {};
  const std::vector<double> norms = squared_norms(graph);
  double heaviest = 0.0;
  for (std::size_t p = 0; p < graph.factor_pools().size(); ++p) {
    const GrowingArray<std::int32_t>& positions = graph.factor_pools()[p].sequence;
    std::vector<double> of_pool, weights(positions.size());
    for (const std::int32_t position : positions) of_pool.push_back(norms[position]);
    graph.weigh(static_cast<int>(p), 0, of_pool, {}, weights);
    for (const double weight : weights) heaviest = std::max(heaviest, weight);
  }
  if (heaviest >= kNoWeight) return {};
  return "the loss leaves no factor any weight at this estimate, so that nothing was optimised: "
         "give "
         "it a larger scale, or begin without it";
}

namespace {

/// Where losses weigh nothing at all, that is said.
std::string rejection(const Graph& graph, bool nearly_all) {
  const RejectedFactors rejected = rejected_factors(graph);
  if (rejected.nearly_all_loops() != nearly_all || !losses_weigh_nothing(graph).empty()) return {};
  return in_words(rejected);
}

}  // namespace

NotesOnEstimate notes_on_estimate(const Graph& graph, double chi2) {
  NotesOnEstimate said;
  said.doubts = reasons_for_doubt(graph, chi2);
  said.notes = said.doubts;
  if (std::string sentence = rejection(graph, false); !sentence.empty())
    said.notes.push_back(std::move(sentence));
  return said;
}

std::vector<std::string> reasons_for_doubt(const Graph& graph, double chi2) {
  std::vector<std::string> sentences;
  for (const std::string& sentence :
       {implausible_estimate(graph, chi2), residual_not_finite(graph), losses_weigh_nothing(graph),
        rejection(graph, true), lower_minimum_nearby(graph, chi2)}) {
    if (!sentence.empty()) sentences.push_back(sentence);
  }
  for (std::string& outside : outside_of_domains(graph)) sentences.push_back(std::move(outside));
  for (std::string& wrong : wrong_jacobians(graph)) sentences.push_back(std::move(wrong));
  return sentences;
}

}  // namespace cairn
