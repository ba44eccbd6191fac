// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/map_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/graph/factor_selector.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/update/rejected_factors.hpp"

namespace cairn {
namespace {

constexpr const char* kOptimizer = "levenberg_marquardt";
constexpr const char* kGuess = "auto";

constexpr const char* kLoss = "geman_mcclure";

/// A loop closure is wrong if its squared residual is so many times what those of the others are
/// per degree of freedom, or what their covariances say: with three or six numbers one in 10¹⁰ is,
/// or in 10⁸. Where more than a third seem to be, there is no saying which are.
constexpr double kFarOff = 50.0, kFew = 1.0 / 3.0;
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

/// Of a graph at a robust estimate: the loop closures that contradict the others.
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

/// Leaves out loop closures that contradict the others. The minimum without them; nothing, and
/// nothing left out, where there are none, or more than a few, or they do not explain chi2.
std::optional<Minimum> leave_out_wrong(Measured& measured, const Minimum& with_all,
                                       const PolicySetting& setting, std::vector<int>& left_out) {
  Measured tried{measured.graph.clone(), measured.positions};
  tried.graph.set_values(setting.data.recording.values());
  tried.graph.set_loss(setting.registry.make<Loss>(kLoss), FactorSelector::loops());
  minimise(tried.graph, setting);
  const RejectedFactors rejected = rejected_factors(tried.graph);
  const std::vector<bool> wrong = far_off(tried.graph, rejected);
  std::vector<int> positions;
  for (std::size_t f = 0; f < wrong.size(); ++f)
    if (wrong[f]) positions.push_back(tried.positions[f]);
  if (positions.empty() ||
      static_cast<double>(std::ssize(positions)) > kFew * static_cast<double>(rejected.loops))
    return std::nullopt;
  tried.graph.set_loss(nullptr);
  take_out(tried, wrong);
  const Minimum minimum = minimise(tried.graph, setting, false);
  if (minimum.status != Status::converged) return std::nullopt;
  if (minimum.per_dof - 1.0 > (1.0 - kExplained) * (with_all.per_dof - 1.0)) return std::nullopt;
  measured = std::move(tried);
  left_out = std::move(positions);
  return minimum;
}

}  // namespace

bool matches_as_recorded(const PolicyJob& job) {
  if (job.own) return false;
  const ComponentSpec registration = parse_component(job.registration);
  return registration.name == "recorded" && !registration.values.contains("false_rate");
}

double extent_of(const Trajectory& poses) {
  double squares = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] =
        std::ranges::minmax(poses, {}, [axis](const TrajectoryPose& pose) { return pose.t[axis]; });
    squares += (high.t[axis] - low.t[axis]) * (high.t[axis] - low.t[axis]);
  }
  return std::sqrt(squares);
}

std::string MapCheck::to_string() const {
  return fmt::format("{:.3g} m from the map of all measurements, {:.2g} % of its extent", distance,
                     extent > 0.0 ? 100.0 * distance / extent : 0.0);
}

EstimateOfAll estimate_of_all(const PolicySetting& setting) {
  EstimateOfAll all;
  Measured measured = measured_of(setting.data);
  if (measured.graph.factor_count() == 0) return {.why_not = "the recording has no measurements"};
  const bool own_losses = setting.loss || measured.graph.has_losses();
  if (setting.loss) measured.graph.set_loss(setting.loss, setting.loss_on);
  Minimum minimum = minimise(measured.graph, setting);
  if (!own_losses && is_large(minimum) && !setting.interrupted())
    minimum = leave_out_wrong(measured, minimum, setting, all.left_out).value_or(minimum);
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

PolicyData without_factors(PolicyData data, std::span<const int> factors) {
  std::vector<bool> leave(data.recording.factor_count());
  for (const int f : factors) leave[f] = true;
  const Renumbering now =
      data.recording.remove(leave, std::vector<bool>(data.recording.variable_count()));
  for (OdometryGap& gap : data.gaps) gap.factor = now.factor[gap.factor];
  std::optional<Id> begin;
  if (!data.poses.empty()) begin = data.recording.id(data.poses.front().pose());
  PolicyData rest = policy_data(std::move(data.recording), std::move(data.truth_graph), begin);
  if (!rest.truth) rest.truth = std::move(data.truth);
  rest.gaps = std::move(data.gaps);
  return rest;
}

std::string left_out_in_words(const EstimateOfAll& all, const PolicyData& data) {
  if (all.left_out.empty()) return {};
  return fmt::format("{} of {} loop closures contradict the others and are left out{} {}",
                     all.left_out.size(), data.loops,
                     all.left_out.size() == 1 ? ":" : ", the first of them",
                     data.recording.describe_factor(all.left_out.front()));
}

std::optional<MapCheck> check_map(const PolicyJob& job, const PolicyResult& result,
                                  const PolicySetting& setting) {
  if (!matches_as_recorded(job) || result.interrupted || result.map_poses > 0) return std::nullopt;
  if (result.poses.size() < 2) return std::nullopt;
  const EstimateOfAll all = estimate_of_all(setting);
  if (!all.why_not.empty()) return std::nullopt;
  const Trajectory everything = trajectory(all.graph);
  return MapCheck{absolute_error(trajectory(result.trajectory), everything), extent_of(everything)};
}

}  // namespace cairn
