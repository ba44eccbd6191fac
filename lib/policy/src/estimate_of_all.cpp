// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/estimate_of_all.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/graph/factor_selector.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/update/rejected_factors.hpp"

namespace cairn {
namespace {

constexpr const char* kOptimizer = "levenberg_marquardt";
constexpr const char* kGuess = "auto";

constexpr const char* kLoss = "geman_mcclure";

/// A measurement is wrong if its squared residual is so many times what those of the others are per
/// degree of freedom, or what their covariances say: with three or six numbers one in 10¹⁰ is, or
/// in 10⁸. Where more than a third of the loop closures seem to be, there is no saying which are.
constexpr double kFarOff = 50.0, kFew = 1.0 / 3.0;
/// So many of the least wrong are tried again without the others.
constexpr std::size_t kTriedAgain = 20;
/// Of what chi2 per degree of freedom is above one, so much has to be due to them.
constexpr double kExplained = 0.5;

/// A graph of a recording, whose factors are at these positions of it.
struct Measured {
  Graph graph;
  std::vector<int> positions;
};

/// Takes some factors out, by position in the graph.
void take_out(Measured& measured, const std::vector<bool>& factors) {
  measured.graph.remove(factors, std::vector<bool>(measured.graph.variable_count()));
  std::vector<int> left;
  for (std::size_t f = 0; f < factors.size(); ++f)
    if (!factors[f]) left.push_back(measured.positions[f]);
  measured.positions = std::move(left);
}

/// The recording, without what bridges gaps.
Measured measured_of(const PolicyData& data) {
  Measured measured{data.recording.clone(), {}};
  const int count = measured.graph.factor_count();
  for (int f = 0; f < count; ++f) measured.positions.push_back(f);
  std::vector<bool> bridges(count);
  for (const OdometryGap& gap : data.gaps) bridges[gap.factor] = true;
  if (!data.gaps.empty()) take_out(measured, bridges);
  return measured;
}

struct Minimum {
  Status status = Status::converged;
  double chi2 = 0.0;
  std::int64_t dof = 1;  ///< at least
  double per_dof = 0.0;
  bool plausible = false;
};

/// From the graph's states and what the guess makes of it.
Minimum minimise(Graph& graph, const PolicySetting& setting, bool guessed = true) {
  const auto optimizer = setting.registry.make<Optimizer>(kOptimizer);
  const auto guess = setting.registry.make<InitialGuess>(kGuess);
  Observer observer;
  const Summary summary =
      optimize(graph, {*optimizer, kOptimizer, guessed ? guess.get() : nullptr, kGuess},
               {.interrupt = setting.interrupt}, observer);
  const std::int64_t dof =
      std::max<std::int64_t>(1, degrees_of_freedom(graph, resolve_gauge(graph)));
  return {.status = summary.status,
          .chi2 = summary.final_chi2,
          .dof = dof,
          .per_dof = summary.final_chi2 / static_cast<double>(dof),
          .plausible = is_plausible(summary.final_chi2, dof)};
}

/// Whether chi2 is larger than chance allows, by more than four standard deviations.
bool is_large(const Minimum& minimum) {
  return minimum.per_dof > 1.0 + 4.0 * std::sqrt(2.0 / static_cast<double>(minimum.dof));
}

/// Of a graph at a robust estimate: the factors that contradict the others.
std::vector<bool> far_off(const Graph& graph, const RejectedFactors& rejected) {
  std::vector<double> norms = squared_norms(graph);
  std::vector<bool> wrong(graph.factor_count());
  double dof = static_cast<double>(degrees_of_freedom(graph, resolve_gauge(graph)));
  for (const int f : rejected.positions) {
    wrong[f] = true;
    dof -= graph.factor_type(f).residual_size();
  }
  double others = 0.0;
  for (std::size_t f = 0; f < norms.size(); ++f) others += wrong[f] ? 0.0 : norms[f];
  const double scale = std::max(1.0, others / std::max(1.0, dof));
  for (const int f : rejected.positions) wrong[f] = norms[f] > kFarOff * scale;
  return wrong;
}

/// Some measurements left out, and the minimum of the others.
struct Explanation {
  Measured rest;
  std::vector<int> left_out;  ///< by position in the recording, rising
  Minimum minimum;
};

/// Takes back, one by one, those of the factors left out with which chi2 hardly rises: beside
/// others that are wrong, right ones seem to be as well.
void take_back(Explanation& found, const PolicySetting& setting) {
  const Graph& recording = setting.data.recording;
  std::vector<std::pair<double, int>> by_residual;
  Graph with_all = found.rest.graph.clone();
  for (const int f : found.left_out) with_all.add(recording.factor(f));
  const std::vector<double> norms = squared_norms(with_all);
  const std::size_t first = norms.size() - found.left_out.size();
  for (std::size_t k = 0; k < found.left_out.size(); ++k)
    by_residual.emplace_back(norms[first + k], found.left_out[k]);
  std::ranges::sort(by_residual);
  if (by_residual.size() > kTriedAgain) by_residual.resize(kTriedAgain);
  for (const auto& [norm, f] : by_residual) {
    Graph with = found.rest.graph.clone();
    with.add(recording.factor(f));
    const Minimum minimum = minimise(with, setting, false);
    const double scale = std::max(1.0, found.minimum.per_dof);
    const bool hardly = minimum.chi2 - found.minimum.chi2 < kFarOff * scale;
    if (minimum.status != Status::converged || !hardly) continue;
    found.rest.graph = std::move(with);
    found.rest.positions.push_back(f);
    found.minimum = minimum;
    std::erase(found.left_out, f);
  }
}

/// What is wrong by a bounded loss on some factors; nothing where nothing is, or where that is too
/// much, explains too little, or holds the graph together.
std::optional<Explanation> explain(const Measured& all, const Minimum& with_all,
                                   const FactorSelector& on, const PolicySetting& setting) {
  Explanation found{.rest = {all.graph.clone(), all.positions}, .left_out = {}, .minimum = {}};
  Graph& graph = found.rest.graph;
  const int components = resolve_gauge(graph).components;
  graph.set_values(setting.data.recording.values());
  graph.set_loss(setting.registry.make<Loss>(kLoss), on);
  minimise(graph, setting);
  const RejectedFactors rejected = rejected_factors(graph);
  const std::vector<bool> wrong = far_off(graph, rejected);
  for (std::size_t f = 0; f < wrong.size(); ++f)
    if (wrong[f]) found.left_out.push_back(found.rest.positions[f]);
  const double most = kFew * static_cast<double>(rejected.loops);
  if (found.left_out.empty() || static_cast<double>(std::ssize(found.left_out)) > most)
    return std::nullopt;
  graph.set_loss(nullptr);
  take_out(found.rest, wrong);
  if (resolve_gauge(graph).components != components) return std::nullopt;
  found.minimum = minimise(graph, setting, false);
  if (found.minimum.status != Status::converged) return std::nullopt;
  if (found.minimum.per_dof - 1.0 > (1.0 - kExplained) * (with_all.per_dof - 1.0))
    return std::nullopt;
  take_back(found, setting);
  return found;
}

/// By as few wrong measurements as possible.
std::optional<Explanation> explain(const Measured& all, const Minimum& with_all,
                                   const PolicySetting& setting) {
  std::optional<Explanation> loops = explain(all, with_all, FactorSelector::loops(), setting);
  if (loops && loops->left_out.size() == 1) return loops;
  std::optional<Explanation> any = explain(all, with_all, FactorSelector::all(), setting);
  if (any && (!loops || any->left_out.size() < loops->left_out.size())) return any;
  return loops;
}

void leave_out(Explanation found, const Graph& recording, EstimateOfAll& all) {
  const std::vector<bool> loops = loop_closures(recording);
  for (const int f : found.left_out) {
    all.left_out_on.push_back(recording.factor(f).variables);
    all.loops_left_out += loops[static_cast<std::size_t>(f)];
  }
  all.left_out = std::move(found.left_out);
}

}  // namespace

bool matches_as_recorded(const PolicyJob& job) {
  if (job.own) return false;
  const ComponentSpec registration = parse_component(job.registration);
  return registration.name == "recorded" && !registration.values.contains("false_rate");
}

EstimateOfAll estimate_of_all(const PolicySetting& setting) {
  EstimateOfAll all;
  Measured measured = measured_of(setting.data);
  if (measured.graph.factor_count() == 0) return {.why_not = "the recording has no measurements"};
  const bool own_losses = setting.loss || measured.graph.has_losses();
  if (setting.loss) measured.graph.set_loss(setting.loss, setting.loss_on);
  Minimum minimum = minimise(measured.graph, setting);
  std::optional<Explanation> found;
  if (!own_losses && is_large(minimum) && !setting.interrupted())
    found = explain(measured, minimum, setting);
  if (found) {
    minimum = found->minimum;
    measured.graph = std::move(found->rest.graph);
    leave_out(std::move(*found), setting.data.recording, all);
  }
  all.graph = std::move(measured.graph);
  all.chi2 = minimum.chi2;
  if (minimum.status != Status::converged) {
    all.why_not =
        fmt::format("the optimisation of all measurements ended as {}", to_string(minimum.status));
  } else if (!minimum.plausible) {
    all.why_not = fmt::format(
        "measurements contradict each other: chi2 of all of them is {:.3g} times the degrees of "
        "freedom",
        minimum.per_dof);
  }
  return all;
}

PolicyData without_contradictions(PolicyData data, const EstimateOfAll& all) {
  std::vector<bool> leave(data.recording.factor_count());
  for (const int f : all.left_out) leave[f] = true;
  for (const OdometryGap& gap : data.gaps) leave[gap.factor] = true;
  data.recording.remove(leave, std::vector<bool>(data.recording.variable_count()));
  std::optional<Id> begin;
  if (!data.poses.empty()) begin = data.recording.id(data.poses.front().pose());
  PolicyData rest =
      policy_data(std::move(data.recording), std::move(data.truth_graph), begin, Gaps::bridge);
  if (!rest.truth) rest.truth = std::move(data.truth);
  return rest;
}

std::string left_out_in_words(const EstimateOfAll& all, const PolicyData& data) {
  if (all.left_out.empty()) return {};
  const auto count = static_cast<int>(std::ssize(all.left_out));
  const std::string what =
      all.loops_left_out == count
          ? fmt::format("{} of {} loop closures contradict the others and are left out", count,
                        data.loops)
          : fmt::format("{} of {} measurements contradict the others and are left out", count,
                        data.recording.factor_count() - static_cast<int>(std::ssize(data.gaps)));
  return fmt::format("{}{} {}", what, count == 1 ? ":" : ", the first of them",
                     data.recording.describe_factor(all.left_out.front()));
}

}  // namespace cairn
