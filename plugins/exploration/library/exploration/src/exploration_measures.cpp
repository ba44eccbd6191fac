// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/exploration_measures.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <variant>
#include <vector>

#include "cairn/evaluation/trajectory.hpp"

namespace cairn {

ResultFields<ExplorationMeasures> ExplorationMeasures::fields() {
  using M = ExplorationMeasures;
  return ResultFields<M>()
      .figure("distance", &M::distance, "m", "driven")
      .label("driven")
      .figure("motions", &M::motions, "motions")
      .detail()
      .figure("decisions", &M::decisions, "decisions")
      .detail()
      .figure("coverage", &M::coverage, "m²", "area of the cells that are known")
      .figure("seen", &M::seen, "m²", "of the true floor around the start, what is known")
      .label("of the floor seen")
      .figure("reachable_seen", &M::reachable_seen, "part of what the body can cover that is known")
      .detail()
      .figure("map_entropy", &M::map_entropy, "nats·m²", "(5.6) over the floor's grid")
      .figure("trajectory_entropy", &M::trajectory_entropy, "nats", "(5.13)")
      .figure("map_error", &M::map_error, "m²", "cells that contradict a scan")
      .figure("wrong", &M::wrong, "m²", "cells that are wrong beside the floor")
      .label("wrong cells")
      .figure("loops", &M::loops, "loop closures")
      .label("loop closures")
      .figure("poses", &M::poses, "poses that are kept")
      .detail()
      .figure("collisions", &M::collisions, "collisions")
      .figure("ate", &M::ate, "m", "absolute trajectory error")
      .label("ATE")
      .figure("ate_rotation", &M::ate_rotation, "deg", "its rotation")
      .detail()
      .figure("expected_ate", &M::expected_ate, "m", "the error that the covariances predict")
      .detail()
      .figure("seconds", &M::seconds, "s", "of the run, without mapping and simulation")
      .label("time")
      .figure("map_seconds", &M::map_seconds, "s", "of mapping")
      .detail()
      .figure("decide_seconds", &M::decide_seconds, "s", "of all decisions")
      .detail()
      .figure("decision_median", &M::decision_median, "s", "of a decision, median")
      .detail()
      .figure("decision_p95", &M::decision_p95, "s", "that 95 % of the decisions do not exceed")
      .label("95 % of decisions")
      .figure("decision_max", &M::decision_max, "s", "of the longest decision")
      .detail();
}

const std::vector<ResultField>& exploration_measures() {
  return result_fields<ExplorationMeasures>().all();
}

double value_of(const ExplorationMeasures& measures, std::size_t measure) {
  return std::get<double>(
      result_fields<ExplorationMeasures>().list().value(measure, &measures).data);
}

bool is_time(const ResultField& measure) { return measure.unit == "s"; }

double entropy_of_area(double entropy, double grid_area, double area) {
  return entropy + std::numbers::ln2 * (area - grid_area);
}

double quantile(std::span<const double> values, double part) {
  if (values.empty()) return 0.0;
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  const double rank = std::ceil(part * static_cast<double>(sorted.size()));
  return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
}

ExplorationMeasures measures_of(const ExplorationResult& result, double floor_area) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  const ExplorationStep& last = result.steps.back();
  const GridFrame& frame = result.map.frame;
  const double grid_area = static_cast<double>(frame.size()) * frame.cell_area();
  ExplorationMeasures m;
  m.distance = last.distance;
  m.motions = last.step;
  m.decisions = static_cast<double>(result.decision_seconds.size());
  m.coverage = result.map.coverage();
  m.map_entropy =
      entropy_of_area(result.map.entropy(), grid_area, floor_area > 0.0 ? floor_area : grid_area);
  m.trajectory_entropy = last.trajectory_entropy;
  m.map_error = result.map_error;
  m.seen = result.against ? result.against->seen : kUnknown;
  m.reachable_seen = result.against ? result.against->reachable_seen.value_or(kUnknown) : kUnknown;
  m.wrong = result.against ? result.against->free_wrong + result.against->occupied_wrong : kUnknown;
  m.loops = result.slam.loops;
  m.poses = result.graph.variable_count();
  m.collisions = result.collisions;
  constexpr int kFewest = 3;  // poses that an alignment needs
  m.ate = m.ate_rotation = kUnknown;
  if (result.truth_trajectory.variable_count() >= kFewest) {
    const TrajectoryError error =
        compare(trajectory(result.trajectory), trajectory(result.truth_trajectory));
    m.ate = error.ate_translation;
    m.ate_rotation = error.ate_rotation;
  }
  m.expected_ate = result.expected_ate;
  m.map_seconds = result.slam.map_seconds;
  m.decide_seconds = result.decide_seconds;
  m.seconds = result.decide_seconds + result.slam.policy_seconds + result.slam.registration_seconds;
  m.decision_median = quantile(result.decision_seconds, 0.5);
  m.decision_p95 = quantile(result.decision_seconds, 0.95);
  m.decision_max = quantile(result.decision_seconds, 1.0);
  return m;
}

}  // namespace cairn
