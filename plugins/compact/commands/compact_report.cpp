// SPDX-License-Identifier: BSD-3-Clause
#include "compact_report.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

#include <fmt/core.h>

#include "cairn/program/error_metric.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

json::object options_json(const OptionValues& values) {
  json::object all;
  for (const auto& [name, value] : values) all[name] = value;
  return all;
}

/// A pose in the table of `--steps`.
struct Step {
  const PoseReport* report;
  std::int64_t poses, loops;  ///< in the graph after it

  static ResultFields<Step> fields() {
    return ResultFields<Step>()
        .part(&Step::report)
        .figure("poses", &Step::poses, "poses in the graph after it")
        .before("seconds.total")
        .figure("loops", &Step::loops, "loop closures in the graph after it")
        .before("seconds.total")
        .at("seconds.total")
        .column("seconds")
        .at("seconds.estimate")
        .column("estimate")
        .at("seconds.covariances")
        .column("covariances")
        .at("seconds.search")
        .column("search");
  }
};

std::string percent(std::int64_t part, std::int64_t whole) {
  return whole == 0 ? "-"
                    : fmt::format("{:.1f} %",
                                  100.0 * static_cast<double>(part) / static_cast<double>(whole));
}

std::string errors_text(const TrajectoryError& error) {
  const Figures figures(error, 4);
  const auto both = [&](const std::string& of) {
    return figures[of + ".translation"] + " " + figures[of + ".rotation"];
  };
  return fmt::format("ATE {}, RPE {}, all to all {}", both("ate"), both("rpe"), both("rpe_all"));
}

std::string loops_text(const PolicyResult& result, const PolicyData& data, bool whole,
                       int left_out) {
  const std::string matched =
      fmt::format("{} pairs matched, {} of them well", result.proposed, result.registered);
  if (whole) {
    return fmt::format("{} used{}; for the choice of poses {}", data.loops,
                       left_out > 0 ? fmt::format(", {} left out", left_out) : "", matched);
  }
  return fmt::format("{} kept ({} of {} recorded); {}", result.kept_loops,
                     percent(result.kept_loops, data.loops), data.loops, matched);
}

void add_result(Table& table, const CompactOutcome& outcome) {
  const PolicyResult& result = outcome.made.result;
  const PolicyData& data = outcome.data;
  const Figures figures(outcome.made);
  const auto in = static_cast<std::int64_t>(std::ssize(result.poses));
  const std::int64_t kept = result.kept_poses - result.map_poses;
  table.add(
      {"poses",
       fmt::format("{} of {} kept ({})", kept, in, percent(kept, in)) +
           (result.map_poses > 0 ? fmt::format(", beside {} of the map", result.map_poses) : "")});
  if (data.loops > 0 || result.registered > 0)
    table.add({"loops", loops_text(result, data, outcome.made.whole.has_value(),
                                   outcome.made.loops_left_out)});
  if (outcome.made.whole) {
    table.add({"factors", fmt::format("{} for {}, KLD {}", figures["whole.factors.out"],
                                      figures["whole.factors.in"], figures["whole.kld"])});
  }
  if (data.priors > 0) {
    table.add({"priors", fmt::format("{} of {} kept ({})", result.kept_priors, data.priors,
                                     percent(result.kept_priors, data.priors))});
  }
  if (data.observations > 0) {
    table.add(
        {"landmarks",
         fmt::format("{} of {} kept, {} of {} measurements of them ({})", result.kept_landmarks,
                     data.landmarks, result.kept_observations, data.observations,
                     percent(result.kept_observations, data.observations)) +
             (result.nonlinear_observations > 0
                  ? fmt::format(", {} left out as not linear", result.nonlinear_observations)
                  : "") +
             (result.undetermined_landmarks > 0
                  ? fmt::format("; {} not determined by what was measured of them",
                                result.undetermined_landmarks)
                  : "")});
  }
  std::string time = figures.times("seconds", {"registration"});
  if (outcome.made.found.seconds > 0.0)
    time += fmt::format(", after {} for the thresholds", figures["thresholds.seconds"]);
  if (outcome.made.estimate_seconds > 0.0)
    time += fmt::format(", after {} for the estimate of all measurements", figures["seconds.all"]);
  if (outcome.made.whole) time += fmt::format(", then {} for the whole", figures["whole.seconds"]);
  table.add({"time", time});
  table.add({"a pose", figures.steps("steps")});
  figures.add_rows(table);
  for (const auto& [name, error] : result.errors) table.add({name, errors_text(error)});
  if (result.normalized && result.normalized->dof > 0) {
    table.add({"NEES", fmt::format("{:.4g} per degree of freedom ({})",
                                   result.normalized->squared / result.normalized->dof,
                                   result.normalized->dof)});
  }
}

}  // namespace

json::object report_json(const CompactOptions& options, const CompactOutcome& outcome) {
  json::object report = begin_report("compact");
  report["graph"] = graph_json(outcome.data.recording, outcome.name);
  report["registration"] = options.registration;
  report["threads"] = threads();
  report["thresholds"] = {
      {"options", options_json(outcome.thresholds.options)},
      {"given", json::array(outcome.thresholds.given.begin(), outcome.thresholds.given.end())},
      {"defaults", options_json(outcome.thresholds.defaults)}};
  put(report, outcome.made);
  if (outcome.like) put(report["like"].emplace_object(), *outcome.like);
  report["recovery"] = options.recovery;
  report["map"] = text_json(options.map);
  report["truth"] = text_json(options.truth);
  report["output"] = text_json(options.output);
  report["trajectory"] = text_json(options.trajectory);
  end_report(report);
  return report;
}

std::string steps_csv(const PolicyResult& result) {
  CsvText csv(result_fields<Step>().all());
  std::int64_t poses = 0, loops = 0;
  for (const PoseReport& pose : result.poses) {
    poses += static_cast<int>(pose.kept) - pose.removed;
    loops += std::ranges::count(pose.links, LinkVerdict::linked, &LinkReport::verdict);
    csv.add(result_record(Step{&pose, poses, loops}));
  }
  return csv.text();
}

std::string summary_text(const CompactOptions& options, const CompactOutcome& outcome,
                         const Results& results, const Session& session) {
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  const PolicyData& data = outcome.data;
  const std::string landmarks =
      data.landmarks > 0 ? ", " + plural(data.landmarks, "landmark") : std::string();
  table.add({"graph", fmt::format("{}: {}{}, {}", outcome.name,
                                  plural(data.recording.variable_count() - data.landmarks, "pose"),
                                  landmarks, plural(data.loops, "loop closure"))});
  add_metric(table, data.recording, session);
  if (!outcome.made.strategy.empty()) table.add({"strategy", outcome.made.strategy});
  if (const std::string line = thresholds_line(outcome.thresholds); !line.empty())
    table.add({"thresholds", line});
  add_result(table, outcome);
  if (outcome.made.check) table.add({"check", outcome.made.check->to_string()});
  if (outcome.made.result.interrupted) {
    table.add({"status", "interrupted"});
  } else if (!outcome.made.result.located) {
    table.add({"status", "unlocated: no pose was matched with one of the map"});
  }
  for (const std::string& file :
       results.written({options.output, options.trajectory, options.save_thresholds, options.steps,
                        options.compare})) {
    table.add({"output", file});
  }
  return table.text(false);
}

}  // namespace cairn::app
