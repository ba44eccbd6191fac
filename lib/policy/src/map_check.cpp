// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/map_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <fmt/core.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/graph/gauge.hpp"

namespace cairn {
namespace {

constexpr const char* kOptimizer = "levenberg_marquardt";
constexpr const char* kGuess = "auto";

/// The recording, without what bridges gaps, with the poses of the run, and its landmarks where it
/// has them.
Graph recording_at(const PolicyResult& result, const PolicySetting& setting) {
  Graph whole = setting.data.recording.clone();
  if (!setting.data.gaps.empty()) {
    std::vector<bool> bridges(whole.factor_count());
    for (const OdometryGap& gap : setting.data.gaps) bridges[gap.factor] = true;
    whole.remove(bridges, std::vector<bool>(whole.variable_count()));
  }
  whole.set_loss(setting.loss, setting.loss_on);
  for (const Graph* from : {&result.compact, &result.trajectory}) {
    for (int v = 0; v < from->variable_count(); ++v) {
      if (const auto there = whole.find(from->id(v)); there && !whole.fixed(*there))
        whole.set_state(*there, from->state(v));
    }
  }
  return whole;
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

EstimateOfAll estimate_of_all(const PolicyJob& job, const PolicyResult& result,
                              const PolicySetting& setting) {
  if (!matches_as_recorded(job)) return {.why_not = "what matches is not what was recorded"};
  if (result.interrupted) return {.why_not = "the run was interrupted"};
  if (result.map_poses > 0) return {.why_not = "the run continues another map"};
  if (result.poses.size() < 2) return {.why_not = "the recording has one pose"};
  if (result.verdicts.contains("inconsistent"))
    return {.why_not = "matches contradict each other, and some of the measurements are wrong"};
  EstimateOfAll all{.graph = recording_at(result, setting)};
  const auto optimizer = setting.registry.make<Optimizer>(kOptimizer);
  const auto guess = setting.registry.make<InitialGuess>(kGuess);
  const Stop stop{.interrupt = setting.interrupt};
  Observer observer;
  const Summary summary =
      optimize(all.graph, {*optimizer, kOptimizer, guess.get(), kGuess}, stop, observer);
  all.chi2 = summary.final_chi2;
  const std::int64_t dof = degrees_of_freedom(all.graph, resolve_gauge(all.graph));
  if (summary.status != Status::converged) {
    all.why_not =
        fmt::format("the optimisation of all measurements ended as {}", to_string(summary.status));
  } else if (!is_plausible(all.chi2, dof)) {
    all.why_not = fmt::format(
        "measurements contradict each other: chi2 of all of them is {:.3g} times the degrees of "
        "freedom",
        all.chi2 / static_cast<double>(dof));
  }
  return all;
}

std::optional<MapCheck> check_map(const PolicyJob& job, const PolicyResult& result,
                                  const PolicySetting& setting) {
  const EstimateOfAll all = estimate_of_all(job, result, setting);
  if (!all.why_not.empty()) return std::nullopt;
  const Trajectory everything = trajectory(all.graph);
  return MapCheck{absolute_error(trajectory(result.trajectory), everything), extent_of(everything)};
}

}  // namespace cairn
