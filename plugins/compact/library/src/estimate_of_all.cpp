// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/estimate_of_all.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
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
/// Where covariances are larger than what they are of, chi2 says nothing, and wrong measurements
/// bend the map at little cost. Then measurements are judged by each other alone: residuals that
/// are not Gaussian have long tails, so that less is wrong, and only what is farther off.
constexpr double kFarOffOthers = 200.0, kFewBesideOthers = 0.05;
constexpr int kRounds = 3;  // each sees what was hidden beside what the one before has left out
/// Residuals as small as rounding have no scale: chi2 per degree of freedom.
constexpr double kWithoutNoise = 1e-9;
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

/// What is wrong.
struct Measure {
  double far_off = kFarOff;  ///< squared residuals above this many times the scale below
  double least_scale = 1.0;  ///< of the others' chi2 per degree of freedom; 0: what that is
  double most = kFew;        ///< part of the loop closures that may be
  std::string loss = kLoss;
};

/// Of a graph at a robust estimate: the factors that contradict the others.
std::vector<bool> far_off(const Graph& graph, const RejectedFactors& rejected,
                          const Measure& measure) {
  std::vector<double> norms = squared_norms(graph);
  std::vector<bool> wrong(graph.factor_count());
  double dof = static_cast<double>(degrees_of_freedom(graph, resolve_gauge(graph)));
  for (const int f : rejected.positions) {
    wrong[f] = true;
    dof -= graph.factor_type(f).residual_size();
  }
  double others = 0.0;
  for (std::size_t f = 0; f < norms.size(); ++f) others += wrong[f] ? 0.0 : norms[f];
  const double scale = std::max(measure.least_scale, others / std::max(1.0, dof));
  for (const int f : rejected.positions) wrong[f] = norms[f] > measure.far_off * scale;
  return wrong;
}

/// Whether it is smaller than that.
bool is_small(const Minimum& minimum) {
  return minimum.per_dof < 1.0 - 4.0 * std::sqrt(2.0 / static_cast<double>(minimum.dof));
}

/// Some measurements left out, and the minimum of the others.
struct Explanation {
  Measured rest;
  std::vector<int> left_out;  ///< by position in the recording, rising
  Minimum minimum;
};

/// Takes back, one by one, those of the factors left out with which chi2 hardly rises: beside
/// others that are wrong, right ones seem to be as well.
void take_back(Explanation& found, const Measure& measure, const PolicySetting& setting) {
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
    const double least = is_small(found.minimum) ? 0.0 : measure.least_scale;
    const double scale = std::max(least, found.minimum.per_dof);
    const bool hardly = minimum.chi2 - found.minimum.chi2 < measure.far_off * scale;
    if (minimum.status != Status::converged || !hardly) continue;
    found.rest.graph = std::move(with);
    found.rest.positions.push_back(f);
    found.minimum = minimum;
    std::erase(found.left_out, f);
  }
}

/// Whether chi2 is that much smaller without what is left out.
bool explains(const Minimum& with_all, const Explanation& found, const Measure& measure) {
  const double left = found.minimum.per_dof;
  if (measure.least_scale > 0.0) return left - 1.0 <= (1.0 - kExplained) * (with_all.per_dof - 1.0);
  const auto count = static_cast<double>(std::ssize(found.left_out));
  return with_all.chi2 - found.minimum.chi2 >= count * measure.far_off * left;
}

/// What is wrong by a bounded loss on some factors; nothing where nothing is, or where that is too
/// much, explains too little, or holds the graph together.
std::optional<Explanation> explain(const Measured& all, const Minimum& with_all,
                                   const FactorSelector& on, const Measure& measure,
                                   const PolicySetting& setting) {
  Explanation found{.rest = {all.graph.clone(), all.positions}, .left_out = {}, .minimum = {}};
  Graph& graph = found.rest.graph;
  const int components = resolve_gauge(graph).components;
  graph.set_values(setting.data.recording.values());
  graph.set_loss(setting.registry.make<Loss>(measure.loss), on);
  minimise(graph, setting);
  const RejectedFactors rejected = rejected_factors(graph);
  const std::vector<bool> wrong = far_off(graph, rejected, measure);
  for (std::size_t f = 0; f < wrong.size(); ++f)
    if (wrong[f]) found.left_out.push_back(found.rest.positions[f]);
  const double most = measure.most * static_cast<double>(rejected.loops);
  if (found.left_out.empty() || static_cast<double>(std::ssize(found.left_out)) > most)
    return std::nullopt;
  graph.set_loss(nullptr);
  take_out(found.rest, wrong);
  if (resolve_gauge(graph).components != components) return std::nullopt;
  found.minimum = minimise(graph, setting, false);
  if (found.minimum.status != Status::converged) return std::nullopt;
  if (!explains(with_all, found, measure)) return std::nullopt;
  take_back(found, measure, setting);
  return found;
}

/// By as few wrong measurements as possible.
std::optional<Explanation> explain(const Measured& all, const Minimum& with_all,
                                   const Measure& measure, const PolicySetting& setting) {
  std::optional<Explanation> loops =
      explain(all, with_all, FactorSelector::loops(), measure, setting);
  if (loops && loops->left_out.size() == 1) return loops;
  std::optional<Explanation> any = explain(all, with_all, FactorSelector::all(), measure, setting);
  if (any && (!loops || any->left_out.size() < loops->left_out.size())) return any;
  return loops;
}

/// Leaves these out besides what is left out already.
void leave_out(std::vector<int> factors, const Graph& recording, EstimateOfAll& all) {
  factors.insert(factors.end(), all.left_out.begin(), all.left_out.end());
  std::ranges::sort(factors);
  all.left_out = std::move(factors);
  all.left_out_on.clear();
  all.loops_left_out = 0;
  const std::vector<bool> loops = loop_closures(recording);
  for (const int f : all.left_out) {
    all.left_out_on.push_back(recording.factor(f).variables);
    all.loops_left_out += loops[static_cast<std::size_t>(f)];
  }
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
  const auto leaves_out = [&](const Measure& measure) {
    if (own_losses || setting.interrupted()) return false;
    std::optional<Explanation> found = explain(measured, minimum, measure, setting);
    if (!found || found->left_out.empty()) return false;
    minimum = found->minimum;
    measured = std::move(found->rest);
    leave_out(std::move(found->left_out), setting.data.recording, all);
    return true;
  };
  if (is_large(minimum)) leaves_out({});
  for (int round = 0; round < kRounds && minimum.per_dof > kWithoutNoise; ++round) {
    // The loss leaves less than 1 % of their weight beyond three times its scale.
    const double scale = std::sqrt(kFarOffOthers * minimum.per_dof) / 3.0;
    if (!leaves_out({.far_off = kFarOffOthers,
                     .least_scale = 0.0,
                     .most = kFewBesideOthers,
                     .loss = fmt::format("{}:scale={}", kLoss, scale)}))
      break;
  }
  all.graph = std::move(measured.graph);
  all.chi2 = minimum.chi2;
  if (!own_losses && is_large(minimum)) {
    all.doubt = fmt::format(
        "chi2 of all measurements is {:.3g} times their degrees of freedom, more than chance "
        "allows: some contradict the others, or covariances are too small",
        minimum.per_dof);
  }
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
