// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/whole_map.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/update/rejected_factors.hpp"

namespace cairn {
namespace {

/// All that may leave does, but for the poses that the job names; those with few neighbours first.
constexpr const char* kSelection = "smallest_blanket:part=1";
/// Nothing relates two landmarks that a pose has seen, so that factors that fit their own blanket
/// alone are too certain in the whole graph.
constexpr const char* kWithLandmarks = "sparsify:fit=scaled";
/// Information has to be positive.
constexpr double kLeastWeight = 1e-9;

/// The graph without losses: the information of each factor times the weight that its loss leaves
/// it, so that the minimum is where it was.
Graph weighted(const Graph& graph) {
  Graph result = graph.clone();
  if (!graph.has_losses()) return result;
  const std::vector<double> weights = loss_weights(graph);
  for (int f = 0; f < graph.factor_count(); ++f) {
    if (!graph.loss(f)) continue;
    const double weight = std::max(weights[static_cast<std::size_t>(f)], kLeastWeight);
    const auto given = graph.information(f);
    std::vector<double> information(given.begin(), given.end());
    for (double& entry : information) entry *= weight;
    result.set_measurement(f, graph.measurement(f), information);
  }
  result.set_loss(nullptr);
  return result;
}

std::int64_t points_of(const Graph& graph) {
  std::int64_t points = 0;
  for (int v = 0; v < graph.variable_count(); ++v) points += is_point(graph.type(v));
  return points;
}

SparsifyResult take_out(const Graph& all, const PolicySetting& setting, const PolicyResult& chosen,
                        const std::function<void(const SparsifyProgress&)>& progress) {
  SparsifyJob job{.sparsifier = parse_component(points_of(all) > 0 ? kWithLandmarks : "sparsify"),
                  .selection = parse_component(kSelection),
                  .optimizer = parse_component("levenberg_marquardt"),
                  .as_given = true};
  for (int v = 0; v < chosen.compact.variable_count(); ++v) {
    if (!is_point(chosen.compact.type(v))) job.stay.push_back(chosen.compact.id(v));
  }
  // Landmarks are what a map is for.
  for (int v = 0; v < all.variable_count(); ++v) {
    if (is_point(all.type(v))) job.stay.push_back(all.id(v));
  }
  return sparsify_whole(weighted(all), job,
                        {.registry = setting.registry,
                         .stop = {.interrupt = setting.interrupt},
                         .progress = progress});
}

Graph without_factors(const Graph& graph) {
  Graph poses;
  for (int v = 0; v < graph.variable_count(); ++v)
    poses.add_variable(graph.type_of(v), graph.id(v), graph.state(v));
  return poses;
}

void replace(PolicyResult& result, const EstimateOfAll& all, SparsifyResult sparse,
             const PolicySetting& setting) {
  result.compact = std::move(sparse.sparse);
  result.trajectory = without_factors(all.graph);
  result.chi2 = all.chi2;
  result.kept_loops = setting.data.loops;
  result.kept_priors = setting.data.priors;
  result.kept_landmarks = points_of(result.compact);
  result.kept_observations = setting.data.observations;
  result.nonlinear_observations = result.undetermined_landmarks = 0;
  result.kept_poses = result.compact.variable_count() - static_cast<int>(result.kept_landmarks);
  result.converged = sparse.converged;
  result.information_nonzeros = sparse.nonzeros_after.information;
  result.factor_nonzeros = sparse.nonzeros_after.factor;
  evaluate_again(result, setting.data, "whole");
}

/// A lower gain of poses than that of the run.
OptionValues lower_pose_gain(const PolicyJob& job, const PolicySetting& setting) {
  constexpr const char* kName = "pose_gain";
  const auto given = job.policy.values.find(kName);
  if (given != job.policy.values.end())
    return {{kName, fmt::format("{:.3g}", 0.5 * std::stod(given->second))}};
  const OptionSpec* own = setting.registry.options(PosePolicy::kKind, job.policy.name).find(kName);
  if (!own) return {};
  return {{kName, fmt::format("{:.3g}", 0.5 * std::stod(own->default_value))}};
}

}  // namespace

std::string why_no_whole_map(const PolicyJob& job, const PolicySetting& setting) {
  if (!matches_as_recorded(job))
    return "what matches is not what was recorded, and so there is no map of all measurements";
  if (std::ssize(setting.data.poses) + setting.data.landmarks !=
      setting.data.recording.variable_count())
    return "the recording has poses of earlier sessions";
  return {};
}

WholeMap take_whole_map(const PolicyJob& job, const PolicySetting& setting,
                        const EstimateOfAll& all, PolicyResult& result,
                        const std::function<void(const SparsifyProgress&)>& progress) {
  const auto begin = std::chrono::steady_clock::now();
  WholeMap map;
  if (result.interrupted) {
    map.why_not = "the run was interrupted";
    return map;
  }
  SparsifyResult sparse = take_out(all.graph, setting, result, progress);
  if (sparse.interrupted) {
    result.interrupted = true;
    map.why_not = "it was interrupted before the map of all measurements was made";
    return map;
  }
  if (!sparse.error && setting.data.landmarks > 0) {
    map.why_not = "what was measured does not determine all landmarks";
    return map;
  }
  const bool absolute = setting.data.priors > 0;
  map.check = {.distance = !sparse.error ? std::nan("")
                           : absolute    ? sparse.error->rmse
                                         : sparse.error->rmse_aligned,
               .extent = extent_of(trajectory(all.graph))};
  if (map.check.is_far()) {
    map.advice = {.finding = fmt::format("the map is {}", map.check.to_string()),
                  .options = lower_pose_gain(job, setting),
                  .effect = "keeps more poses, and mostly loses less"};
    if (map.advice->options.empty()) map.advice.reset();
  }
  map.kld = sparse.error ? sparse.error->kld : std::nan("");
  map.factors_in = sparse.factors_before;
  map.factors_out = sparse.sparse.factor_count();
  if (!sparse.change.removed_variables.empty()) map.notes = std::move(sparse.notes);
  replace(result, all, std::move(sparse), setting);
  map.seconds = seconds_since(begin);
  return map;
}

ResultFields<WholeMap> WholeMap::fields() {
  using W = WholeMap;
  return ResultFields<W>()
      .figure("kld", &W::kld, "nats",
              "divergence of the graph from the estimate of all measurements, of the poses kept")
      .round("{:.3g}")
      .figure("factors.in", &W::factors_in, "factors of the recording")
      .figure("factors.out", &W::factors_out, "factors of the compact graph")
      .figure("seconds", &W::seconds, "s", "giving the poses kept the information of all")
      .details();
}

}  // namespace cairn
