// SPDX-License-Identifier: BSD-3-Clause
#include "compact_report.hpp"

#include <cmath>
#include <cstdint>
#include <utility>

#include <fmt/core.h>

#include "cairn/program/error_metric.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/step_times.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

json::object options_json(const OptionValues& values) {
  json::object all;
  for (const auto& [name, value] : values) all[name] = value;
  return all;
}

json::object thresholds_json(const UsedThresholds& used, const FoundThresholds& found) {
  json::array trials;
  for (const ThresholdTrial& trial : found.trials) {
    trials.push_back({{"loop_gain_factor", trial.links},
                      {"pose_gain_factor", trial.poses},
                      {"expected_error", trial.expected},
                      {"realised_error", trial.realised},
                      {"poses", trial.poses_kept},
                      {"loops", trial.loops_kept}});
  }
  json::array given;
  for (const std::string& name : used.given) given.emplace_back(name);
  return {{"options", options_json(used.options)},
          {"given", std::move(given)},
          {"defaults", options_json(used.defaults)},
          {"trials", std::move(trials)},
          {"chosen", found.chosen},
          {"noise_scale", found.noise_scale},
          {"expected_ate", found.expected_ate},
          {"tolerance", found.tolerance},
          {"seconds", found.seconds}};
}

json::object error_json(const TrajectoryError& e) {
  const auto pair = [](double translation, double rotation) {
    return json::object{{"translation", translation}, {"rotation", rotation}};
  };
  return {{"poses", e.poses},
          {"ate", pair(e.ate_translation, e.ate_rotation)},
          {"rpe", pair(e.rpe_translation, e.rpe_rotation)},
          {"rpe_all", pair(e.rpe_all_translation, e.rpe_all_rotation)}};
}

std::vector<double> step_seconds(const PolicyResult& result) {
  std::vector<double> seconds;
  for (const PoseReport& pose : result.poses) seconds.push_back(pose.seconds.total);
  return seconds;
}

json::object result_json(const PolicyResult& result, const PolicyData& data) {
  json::object report;
  report["policy"] = result.policy;
  report["poses"] = {{"in", result.poses.size()},
                     {"kept", result.kept_poses - result.map_poses},
                     {"map", result.map_poses}};
  report["loops"] = {{"in", data.loops},
                     {"proposed", result.proposed},
                     {"registered", result.registered},
                     {"kept", result.kept_loops},
                     {"false_registered", result.false_registered},
                     {"false_kept", result.false_kept}};
  report["priors"] = {{"in", data.priors}, {"kept", result.kept_priors}};
  report["landmarks"] = {{"in", data.landmarks},
                         {"kept", result.kept_landmarks},
                         {"undetermined", result.undetermined_landmarks}};
  report["observations"] = {{"in", data.observations},
                            {"kept", result.kept_observations},
                            {"nonlinear", result.nonlinear_observations}};
  json::object verdicts;
  for (const auto& [name, count] : result.verdicts) verdicts[name] = count;
  report["verdicts"] = std::move(verdicts);
  report["chi2"] = {{"final", result.chi2}};
  report["seconds"] = {{"total", result.seconds.total},
                       {"estimate", result.seconds.estimate},
                       {"covariances", result.seconds.covariances},
                       {"search", result.seconds.search},
                       {"registration", result.registration_seconds}};
  report["steps"] = step_times_json(StepTimes(step_seconds(result)));
  report["nonzeros"] = {{"information", result.information_nonzeros},
                        {"factor", result.factor_nonzeros}};
  json::object errors;
  for (const auto& [name, error] : result.errors) errors[name] = error_json(error);
  report["errors"] = errors.empty() ? json::value(nullptr) : json::value(std::move(errors));
  auto shown = result.errors.find("v2");
  if (shown == result.errors.end()) shown = result.errors.find("whole");
  report["rmse"] = shown == result.errors.end() ? json::value(nullptr)
                                                : json::value(shown->second.ate_translation);
  if (result.normalized) {
    report["nees"] = {{"squared", result.normalized->squared}, {"dof", result.normalized->dof}};
  } else {
    report["nees"] = nullptr;
  }
  return report;
}

std::string percent(std::int64_t part, std::int64_t whole) {
  return whole == 0 ? "-"
                    : fmt::format("{:.1f} %",
                                  100.0 * static_cast<double>(part) / static_cast<double>(whole));
}

std::string errors_text(const TrajectoryError& e) {
  return fmt::format(
      "ATE {:.4g} m {:.4g} deg, RPE {:.4g} m {:.4g} deg, all to all {:.4g} m {:.4g} deg",
      e.ate_translation, e.ate_rotation, e.rpe_translation, e.rpe_rotation, e.rpe_all_translation,
      e.rpe_all_rotation);
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
  const PolicyResult& result = outcome.shown();
  const PolicyData& data = outcome.data;
  const FoundThresholds& found = outcome.made.found;
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
    table.add({"factors", fmt::format("{} for {}, KLD {:.3g} nats", outcome.made.whole->factors_out,
                                      outcome.made.whole->factors_in, outcome.made.whole->kld)});
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
  const StepTimes times(step_seconds(result));
  const std::string whole =
      outcome.made.whole
          ? fmt::format(", then {} for the whole", seconds_text(outcome.made.whole->seconds))
          : "";
  table.add(
      {"time",
       fmt::format("{} (estimate {}, covariances {}, search {}){}",
                   seconds_text(result.seconds.total), seconds_text(result.seconds.estimate),
                   seconds_text(result.seconds.covariances), seconds_text(result.seconds.search),
                   found.seconds > 0.0
                       ? fmt::format(", after {} for the thresholds", seconds_text(found.seconds))
                       : "") +
           whole});
  table.add({"a pose", times.text()});
  table.add({"chi2", chi2_text(result.chi2)});
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
  report["strategy"] = text_json(outcome.made.strategy);
  report["registration"] = options.registration;
  report["threads"] = threads();
  report["status"] = outcome.made.result.interrupted ? "interrupted"
                     : !outcome.shown().located      ? "unlocated"
                     : outcome.shown().converged     ? "converged"
                                                     : "max_iterations";
  report["thresholds"] = thresholds_json(outcome.thresholds, outcome.made.found);
  for (auto& [name, value] : result_json(outcome.shown(), outcome.data)) report[name] = value;
  report["loops"].as_object()["in"] = outcome.data.loops + outcome.made.loops_left_out;
  if (outcome.control) report["like"] = result_json(outcome.made.result, outcome.data);
  if (outcome.check) {
    report["check"] = {{"distance", outcome.check->distance}, {"extent", outcome.check->extent}};
  } else {
    report["check"] = nullptr;
  }
  if (const auto& whole = outcome.made.whole) {
    report["whole"] = {{"kld", number_json(whole->kld)},
                       {"factors", {{"in", whole->factors_in}, {"out", whole->factors_out}}},
                       {"seconds", whole->seconds}};
  } else {
    report["whole"] = nullptr;
  }
  json::array left_out;
  for (const std::vector<Id>& on : outcome.made.left_out)
    left_out.emplace_back(json::array(on.begin(), on.end()));
  report["left_out"] = std::move(left_out);
  report["recovery"] = options.recovery;
  report["map"] = text_json(options.map);
  report["located"] = outcome.made.result.located;
  report["truth"] = text_json(options.truth);
  report["output"] = text_json(options.output);
  report["trajectory"] = text_json(options.trajectory);
  end_report(report);
  return report;
}

json::object comparison_json(const std::vector<UncertaintyStep>& steps) {
  const Conservativeness c = conservativeness(steps);
  return {{"steps", steps.size()},
          {"marginal_conservative", c.marginal},
          {"full_conservative", c.full},
          {"least_marginal_ratio", c.least_marginal_ratio},
          {"least_full_ratio", c.least_full_ratio},
          {"least_eigenvalue", c.least_eigenvalue}};
}

std::string comparison_csv(const std::vector<UncertaintyStep>& steps) {
  std::string text = "pose,kept,marginal,marginal_all,full,full_all,least_eigenvalue\n";
  for (const UncertaintyStep& s : steps) {
    text += fmt::format("{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}\n", s.pose, s.kept, s.marginal,
                        s.marginal_all, s.full, s.full_all, s.least_eigenvalue);
  }
  return text;
}

std::string steps_csv(const PolicyResult& result) {
  std::string text =
      "pose,kept,closed_loop,near,candidates,least_gain,matched,linked,poses,loops,seconds,"
      "estimate,covariances,search\n";
  std::int64_t poses = 0, loops = 0;
  for (const PoseReport& pose : result.poses) {
    std::int64_t matched = 0, linked = 0;
    for (const LinkReport& link : pose.links) {
      matched += link.verdict != LinkVerdict::unmatched;
      linked += link.verdict == LinkVerdict::linked;
    }
    poses += static_cast<int>(pose.kept) - pose.removed;
    loops += linked;
    text +=
        fmt::format("{},{},{},{},{},{},{},{},{},{},{:.9f},{:.9f},{:.9f},{:.9f}\n", pose.id,
                    pose.kept ? 1 : 0, pose.closed_loop ? 1 : 0, pose.near, pose.candidates,
                    std::isfinite(pose.least_gain) ? fmt::format("{:.9g}", pose.least_gain) : "",
                    matched, linked, poses, loops, pose.seconds.total, pose.seconds.estimate,
                    pose.seconds.covariances, pose.seconds.search);
  }
  return text;
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
  if (outcome.check) table.add({"check", outcome.check->to_string()});
  if (outcome.made.result.interrupted) {
    table.add({"status", "interrupted"});
  } else if (!outcome.shown().located) {
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
