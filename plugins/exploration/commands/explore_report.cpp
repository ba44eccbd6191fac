// SPDX-License-Identifier: BSD-3-Clause
#include "explore_report.hpp"

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/evaluation/trajectory.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/table.hpp"
#include "floors.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

std::optional<TrajectoryError> error_of(const ExplorationResult& result) {
  if (result.truth_trajectory.variable_count() < 3) return std::nullopt;
  return compare(trajectory(result.trajectory), trajectory(result.truth_trajectory));
}

/// What only the world knows: how much of its floor is seen, what of the map is wrong, how far the
/// trajectory is off.
std::string truth_text(const ExplorationResult& result) {
  std::vector<std::string> parts;
  if (result.against) {
    const MapTruth& truth = *result.against;
    parts.push_back(truth.floor > 0.0
                        ? fmt::format("{:.1f} m² ({:.1f} %) of the {:.1f} m² that hang together "
                                      "with the start",
                                      truth.seen, 100.0 * truth.seen / truth.floor, truth.floor)
                        : "the start is not on free floor");
    if (truth.reachable_seen)
      parts.back() +=
          fmt::format(", {:.1f} % of what the body can cover", 100.0 * *truth.reachable_seen);
    parts.push_back(fmt::format("wrong: {:.2f} m² free, {:.2f} m² occupied", truth.free_wrong,
                                truth.occupied_wrong));
  }
  if (const auto error = error_of(result))
    parts.push_back(fmt::format("error {:.3f} m, {:.2f}° (ATE, aligned)", error->ate_translation,
                                error->ate_rotation));
  return fmt::format("{}", fmt::join(parts, "; "));
}

json::object decisions_json(const ExplorationResult& result) {
  return {{"count", result.decision_seconds.size()},
          {"median_seconds", quantile(result.decision_seconds, 0.5)},
          {"p95_seconds", quantile(result.decision_seconds, 0.95)},
          {"p99_seconds", quantile(result.decision_seconds, 0.99)},
          {"max_seconds", quantile(result.decision_seconds, 1.0)}};
}

json::object map_json(const ExplorationResult& result) {
  json::object map{{"cells", {result.map.frame.width, result.map.frame.height}},
                   {"resolution", result.map.frame.resolution},
                   {"coverage", result.map.coverage()},
                   {"entropy", result.map.entropy()},
                   {"error", result.map_error},
                   {"rebuilt", result.slam.rebuilt}};
  if (result.against) {
    map["truth"] = {{"floor", result.against->floor},
                    {"seen", result.against->seen},
                    {"free_wrong", result.against->free_wrong},
                    {"occupied_wrong", result.against->occupied_wrong}};
    if (result.against->reachable_seen)
      map["truth"].as_object()["reachable_seen"] = *result.against->reachable_seen;
  }
  return map;
}

}  // namespace

void put_measures(json::object& report, const ExplorationMeasures& measures) {
  json::object numbers, seconds;
  const std::vector<ResultField>& fields = exploration_measures();
  for (std::size_t k = 0; k < fields.size(); ++k)
    (is_time(fields[k]) ? seconds : numbers)[fields[k].name] = number_json(value_of(measures, k));
  report["measures"] = std::move(numbers);
  report["measured_seconds"] = std::move(seconds);
}

json::object report_json(const ExploreOutcome& outcome) {
  const ExplorationResult& result = outcome.result;
  const ExplorationStep& last = result.steps.back();
  json::object report = begin_report("explore");
  if (!outcome.floor.empty()) report["floor"] = frame_json(outcome.floor, outcome.frame);
  report["world"] = outcome.parts.world;
  report["policy"] = outcome.parts.policy;
  report["registration"] = outcome.parts.registration;
  report["mapper"] = outcome.parts.mapper;
  report["explorer"] = outcome.parts.explorer;
  report["loss"] = outcome.parts.loss;
  report["seed"] = outcome.parts.seed;
  report["repeatable"] = outcome.repeatable;
  if (result.start) report["start"] = {result.start->x(), result.start->y(), result.start->theta()};
  report["end"] = std::string(to_string(result.end));
  report["why"] = result.why;
  report["motions"] = last.step;
  report["distance"] = last.distance;
  report["collisions"] = result.collisions;
  report["poses"] = result.trajectory.variable_count();
  report["kept"] = result.graph.variable_count();
  report["loops"] = {{"proposed", result.slam.proposed},
                     {"matched", result.slam.registered},
                     {"linked", result.slam.loops}};
  report["converged"] = result.converged;
  report["trajectory_entropy"] = number_json(last.trajectory_entropy);
  report["map"] = map_json(result);
  report["decisions"] = decisions_json(result);
  if (const auto error = error_of(result)) {
    report["error"] = {{"ate_translation", error->ate_translation},
                       {"ate_rotation", error->ate_rotation}};
  }
  report["seconds"] = {{"decide", result.decide_seconds},
                       {"map", result.slam.map_seconds},
                       {"policy", result.slam.policy_seconds},
                       {"registration", result.slam.registration_seconds}};
  put_measures(report, measures_of(result, static_cast<double>(outcome.frame.size()) *
                                               outcome.frame.cell_area()));
  report["notes"] = strings_json(result.notes);
  report["steps"] = to_json(result.steps);
  return report;
}

std::string steps_csv(const ExplorationResult& result) {
  return csv_of<ExplorationStep>(result.steps);
}

std::string summary_text(const ExploreOutcome& outcome) {
  const ExplorationResult& result = outcome.result;
  const ExplorationStep& last = result.steps.back();
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  table.add({"end", fmt::format("{}: {}", to_string(result.end), result.why)});
  table.add(
      {"drive", fmt::format("{:.1f} m in {}, {}, {}", last.distance, plural(last.step, "motion"),
                            plural(std::ssize(result.decision_seconds), "decision"),
                            plural(result.collisions, "collision"))});
  table.add({"map", fmt::format("{:.1f} m² known", result.map.coverage())});
  table.add({"graph", fmt::format("{} of {} kept, {}", result.graph.variable_count(),
                                  plural(result.trajectory.variable_count(), "pose"),
                                  plural(result.slam.loops, "loop closure")) +
                          fmt::format("; an error of {:.3f} m by the covariances (ATE)",
                                      result.expected_ate)});
  if (const std::string truth = truth_text(result); !truth.empty()) table.add({"truth", truth});
  table.add({"time",
             fmt::format("{} deciding, {} mapping, {} estimating, {} matching scans",
                         seconds_text(result.decide_seconds), seconds_text(result.slam.map_seconds),
                         seconds_text(result.slam.policy_seconds),
                         seconds_text(result.slam.registration_seconds))});
  return table.text(false);
}

}  // namespace cairn::app
