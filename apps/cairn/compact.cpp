// SPDX-License-Identifier: BSD-3-Clause
// cairn compact GRAPH: compact pose SLAM, which keeps the poses and loop closures that tell most.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/threshold_search.hpp"
#include "cairn/policy/uncertainty_comparison.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "commands.hpp"
#include "compact.hpp"
#include "graph_files.hpp"
#include "help.hpp"
#include "interrupt.hpp"
#include "json_report.hpp"
#include "problem_setup.hpp"
#include "progress.hpp"
#include "step_times.hpp"
#include "table.hpp"
#include "threshold_files.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

Recovery recovery_of(const std::string& name) {
  return std::ranges::find(kRecoveryNames, name, &decltype(kRecoveryNames)::value_type::first)
      ->second;
}

// Input -------------------------------------------------------------------------------------------

struct Recording {
  std::string name;
  PolicyData data;
};

Recording load_recording(const CompactOptions& options, Session& session) {
  LoadedGraph loaded = load_graph(options.graph, options.input, session);
  if (!options.truth.empty())
    loaded.truth = load_graph(options.truth, options.input, session).graph;
  return {loaded.name, policy_data(std::move(loaded.graph), std::move(loaded.truth))};
}

/// Shows how far a run is.
class PolicyProgress {
 public:
  explicit PolicyProgress(bool quiet) : line_(quiet) {}
  void show(std::string_view title, std::size_t count, const PolicyResult& result) {
    const std::size_t at = result.poses.size();
    if (at == 1) kept_ = 0;
    kept_ += result.poses.back().kept;
    const auto now = std::chrono::steady_clock::now();
    if (now - shown_ < std::chrono::milliseconds(line_.on_terminal() ? 50 : 5000)) return;
    shown_ = now;
    line_.show(fmt::format("{} {} pose {} of {}: {} kept, {}, {}", title,
                           bar(static_cast<double>(at) / static_cast<double>(count), 20), at, count,
                           kept_, plural(result.kept_loops, "loop closure"),
                           seconds_text(result.seconds.total)));
  }
  void clear() { line_.clear(); }

 private:
  int kept_ = 0;
  StatusLine line_;
  std::chrono::steady_clock::time_point shown_ = std::chrono::steady_clock::now();
};

// Thresholds --------------------------------------------------------------------------------------

json::object options_json(const OptionValues& values) {
  json::object all;
  for (const auto& [name, value] : values) all[name] = value;
  return all;
}

json::object thresholds_json(const FoundThresholds& found) {
  json::array trials;
  for (const ThresholdTrial& trial : found.trials) {
    trials.push_back({{"loop_gain_factor", trial.links},
                      {"pose_gain_factor", trial.poses},
                      {"expected_error", trial.expected},
                      {"realised_error", trial.realised},
                      {"poses", trial.poses_kept},
                      {"loops", trial.loops_kept}});
  }
  return {{"options", options_json(found.options)},
          {"trials", std::move(trials)},
          {"expected_ate", found.expected_ate},
          {"tolerance", found.tolerance},
          {"seconds", found.seconds}};
}

/// Those that the command line gives by themselves.
OptionValues given_thresholds(const CompactOptions& options) {
  OptionValues values;
  const auto put = [&](const char* name, const std::optional<double>& value) {
    if (value) values[name] = fmt::format("{}", *value);
  };
  put("range", options.range);
  put("angle", options.angle);
  put("loop_gain", options.loop_gain);
  put("pose_gain", options.pose_gain);
  put("gate", options.gate);
  return values;
}

bool names_thresholds(const CompactOptions& options, const ComponentSpec& policy) {
  return options.range || options.angle || options.loop_gain || options.pose_gain ||
         !options.thresholds.empty() || policy.values.contains("range") ||
         policy.values.contains("loop_gain") || policy.values.contains("pose_gain");
}

/// What to run, and the thresholds that were found, or read.
struct Job {
  PolicyJob job;
  FoundThresholds found;
};

Job prepare(const CompactOptions& options, const PolicySetting& setting) {
  Job result;
  PolicyJob& job = result.job;
  job.registration = options.registration;
  job.policy = parse_component(options.policy);
  const auto emplace = [&](const OptionValues& values) {
    for (const auto& [name, value] : values) job.policy.values.emplace(name, value);
  };
  const bool automatic = options.automatic || !names_thresholds(options, job.policy);
  emplace(given_thresholds(options));
  if (!options.estimator.empty()) emplace({{"estimator", options.estimator}});
  if (!options.thresholds.empty())
    result.found.options = read_thresholds(options.thresholds, job.policy.name);
  if (automatic) {
    const auto poses = static_cast<double>(setting.data.poses.size());
    const auto count =
        std::max<std::size_t>(1, static_cast<std::size_t>(std::llround(options.sample * poses)));
    result.found = find_thresholds(job, count, options.error_ratio, setting);
  }
  emplace(result.found.options);
  const OptionTable& table = setting.registry.options(PosePolicy::kKind, job.policy.name);
  if (table.find("strategy"))
    emplace({{"strategy", options.strategy == "rfpfl" ? "fpfl" : options.strategy}});
  if (!options.save_thresholds.empty())
    write_thresholds(options.save_thresholds, job.policy.name, result.found.options);
  return result;
}

// The report --------------------------------------------------------------------------------------

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

json::object result_json(const PolicyResult& result, const Recording& recording) {
  json::object report;
  report["policy"] = result.policy;
  report["poses"] = {{"in", result.poses.size()}, {"kept", result.compact.variable_count()}};
  report["loops"] = {{"in", recording.data.loops},
                     {"proposed", result.proposed},
                     {"registered", result.registered},
                     {"kept", result.kept_loops},
                     {"false_registered", result.false_registered},
                     {"false_kept", result.false_kept}};
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
  const auto v2 = result.errors.find("v2");
  report["rmse"] =
      v2 == result.errors.end() ? json::value(nullptr) : json::value(v2->second.ate_translation);
  if (result.normalized) {
    report["nees"] = {{"squared", result.normalized->squared}, {"dof", result.normalized->dof}};
  } else {
    report["nees"] = nullptr;
  }
  return report;
}

json::object report_json(const CompactOptions& options, const Recording& recording, const Job& job,
                         const PolicyResult& result, const std::optional<PolicyResult>& control) {
  json::object report = begin_report("compact");
  report["graph"] = graph_json(recording.data.recording, recording.name);
  report["strategy"] = options.strategy;
  report["registration"] = options.registration;
  report["threads"] = threads();
  report["status"] = result.interrupted ? "interrupted" : "converged";
  report["thresholds"] = thresholds_json(job.found);
  for (auto& [name, value] : result_json(control ? *control : result, recording))
    report[name] = value;
  if (control) report["like"] = result_json(result, recording);
  report["recovery"] = options.recovery;
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
    poses += pose.kept;
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

void add_result(Table& table, const PolicyResult& result, const Recording& recording) {
  const auto in = static_cast<std::int64_t>(std::ssize(result.poses));
  table.add({"poses", fmt::format("{} of {} kept ({})", result.compact.variable_count(), in,
                                  percent(result.compact.variable_count(), in))});
  table.add(
      {"loops", fmt::format("{} kept ({} of {} recorded); {} pairs matched, {} of them well",
                            result.kept_loops, percent(result.kept_loops, recording.data.loops),
                            recording.data.loops, result.proposed, result.registered)});
  const StepTimes times(step_seconds(result));
  table.add(
      {"time",
       fmt::format("{} (estimate {}, covariances {}, search {})",
                   seconds_text(result.seconds.total), seconds_text(result.seconds.estimate),
                   seconds_text(result.seconds.covariances), seconds_text(result.seconds.search))});
  table.add({"a pose", times.text()});
  table.add({"chi2", chi2_text(result.chi2)});
  for (const auto& [name, error] : result.errors) table.add({name, errors_text(error)});
  if (result.normalized && result.normalized->dof > 0) {
    table.add({"NEES", fmt::format("{:.4g} a degree of freedom ({})",
                                   result.normalized->squared / result.normalized->dof,
                                   result.normalized->dof)});
  }
}

std::string thresholds_line(const OptionValues& values) {
  std::string text;
  for (const auto& [name, value] : values) {
    if (name == "sensor") continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name, value);
  }
  return text;
}

std::string summary_text(const CompactOptions& options, const Recording& recording, const Job& job,
                         const PolicyResult& result, const std::optional<PolicyResult>& control) {
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  table.add({"graph", fmt::format("{}: {}, {}", recording.name,
                                  plural(recording.data.recording.variable_count(), "pose"),
                                  plural(recording.data.loops, "loop closure"))});
  table.add({"strategy", options.strategy});
  if (!job.found.options.empty()) table.add({"thresholds", thresholds_line(job.found.options)});
  add_result(table, control ? *control : result, recording);
  if (result.interrupted) table.add({"status", "interrupted"});
  for (const std::string& file : {options.output, options.trajectory, options.save_thresholds,
                                  options.steps, options.compare}) {
    if (!file.empty() && file != "-") table.add({"written", file});
  }
  return table.text(false);
}

void check(const CompactOptions& options, Session& session) {
  if (options.output == "-" || options.trajectory == "-") session.write_file_to_stdout();
  if (options.output == "-" && options.trajectory == "-")
    throw Error(ErrorCode::usage, "only one of -o and --trajectory can go to standard output");
  check_output(options.output, options.output_format, session);
  check_output(options.trajectory, "", session);
  if (!options.steps.empty()) check_folder(options.steps);
  if (!options.compare.empty()) check_folder(options.compare);
  if (!options.save_thresholds.empty()) check_folder(options.save_thresholds);
  if (options.automatic && !options.thresholds.empty())
    throw Error(ErrorCode::usage, "--auto finds thresholds, --thresholds reads them: give one");
}

}  // namespace

int run_compact(const CompactOptions& options, Session& session) {
  check(options, session);
  session.use_threads();
  Registry& registry = session.registry();
  const ProblemSetup setup(options.problem, registry);
  const Recording recording = load_recording(options, session);
  const InterruptGuard guard;  // until the results are written
  PolicyProgress progress(session.common.quiet);
  const PolicySetting setting{
      .data = recording.data,
      .registry = registry,
      .loss = setup.loss(),
      .loss_scope = setup.loss_scope(),
      .interrupt = &guard.flag(),
      .progress = [&](std::string_view title, std::size_t count, const PolicyResult& counts) {
        progress.show(title, count, counts);
      }};
  const Job job = prepare(options, setting);
  const Recovery recovery = recovery_of(options.recovery);
  std::optional<UncertaintyComparison> comparison;
  if (!options.compare.empty()) {
    comparison.emplace(recording.data, registry.make<Estimator>("incremental_cholesky"));
  };
  const auto run_job = [&](const PolicyJob& chosen, UncertaintyComparison* compare) {
    PolicyRun run(chosen, setting);
    run.run(recording.data.poses.size(), chosen.policy.name, [&](std::size_t index) {
      if (compare) compare->add(index, run.policy());
    });
    progress.clear();
    return run.finish(recovery);
  };
  const PolicyResult result = run_job(job.job, comparison ? &*comparison : nullptr);
  std::optional<PolicyResult> control;
  if (options.strategy == "rfpfl") {
    PolicyJob random = job.job;
    random.policy = {"random_poses",
                     {{"poses", fmt::format("{}", result.compact.variable_count())},
                      {"loops", fmt::format("{}", result.kept_loops)},
                      {"seed", fmt::format("{}", options.seed)}}};
    control = run_job(random, nullptr);
  }
  const PolicyResult& shown = control ? *control : result;
  if (!options.output.empty())
    write_graph(shown.compact, options.output, registry, options.output_format);
  if (!options.trajectory.empty()) write_graph(shown.way, options.trajectory, registry);
  if (!options.steps.empty()) write_file(options.steps, steps_csv(shown));
  json::object report = report_json(options, recording, job, result, control);
  if (comparison) {
    write_file(options.compare, comparison_csv(comparison->steps()));
    report["compare"] = comparison_json(comparison->steps());
  }
  session.write_json(report);
  session.print(summary_text(options, recording, job, result, control));
  return guard.interrupted() ? kExitInterrupted : 0;
}

void add_compact_options(CLI::App& command, CompactOptions& options,
                         std::vector<std::string> strategies) {
  command.add_option("graph", options.graph, kGraphHelp)->type_name("GRAPH")->required();
  command.add_option("-o,--output", options.output, "write the compact graph")->type_name("OUT");
  command.add_option("--to", options.output_format, "format of OUT")->type_name("FORMAT");
  command
      .add_option("--trajectory", options.trajectory, "write all poses, those left out put back")
      ->type_name("FILE");
  command
      .add_option("--recovery", options.recovery,
                  "v0 evenly, v1 by distance, v2 along odometry, or likely")
      ->type_name("HOW")
      ->check(one_of({"v0", "v1", "v2", "likely"}))
      ->capture_default_str();
  command
      .add_option("--strategy", options.strategy, "all or few poses and loops: apal, apfl, fpfl")
      ->type_name("NAME")
      ->check(one_of(std::move(strategies)))
      ->capture_default_str();
  command.add_option("--policy", options.policy, "who decides, with options as NAME:key=value")
      ->type_name("NAME")
      ->capture_default_str();
  command
      .add_option("--estimator", options.estimator, "who estimates, instead of the policy's own")
      ->type_name("NAME");
  command
      .add_option("--registration", options.registration,
                  "who measures loops: recorded, or simulated:range=5,angle=1,false_rate=0.1")
      ->type_name("NAME")
      ->capture_default_str();
  command.add_flag("--auto", options.automatic,
                   "find thresholds in a sample; so it is if none are given");
  command.add_option("--sample", options.sample, "part of the poses that is the sample")
      ->type_name("PART")
      ->check(within(0.0, 1.0))
      ->capture_default_str();
  command.add_option("--thresholds", options.thresholds, "take thresholds from a file")
      ->type_name("FILE");
  command.add_option("--save-thresholds", options.save_thresholds, "write those found to a file")
      ->type_name("FILE");
  command.add_option("--range", options.range, "how far the sensor matches [m]")->type_name("M");
  command.add_option("--angle", options.angle, "and between which orientations [rad]")
      ->type_name("RAD");
  command.add_option("--loop-gain", options.loop_gain, "a loop must tell more [nats]")
      ->type_name("G");
  command
      .add_option("--pose-gain", options.pose_gain, "a pose is kept if links to it would tell more")
      ->type_name("G");
  command
      .add_option("--gate", options.gate,
                  "refuse links that do not fit; so large a part of right ones passes (0.99)")
      ->type_name("P");
  command.add_option("--truth", options.truth, "true poses, for errors")->type_name("FILE");
  command.add_option("--steps", options.steps, "a row for each pose, as CSV")->type_name("FILE");
  add_loss_options(command, options.problem);
  add_input_options(command, options.input);
}

Command add_compact(CLI::App& program) {
  auto options = std::make_shared<CompactOptions>();  // lives as long as the parser and the run
  CLI::App* app = program.add_subcommand(
      "compact", "compact pose SLAM: keep only the poses and loop closures that tell much");
  add_compact_options(*app, *options, {"apal", "apfl", "fpfl"});
  app->footer(
      "Example:\n"
      "  cairn compact my.g2o -o compact.g2o --trajectory full.g2o --json report.json\n"
      "  cairn compact city.g2o --strategy apal --thresholds city.json --truth truth.g2o");
  return {app, [options](Session& session) { return run_compact(*options, session); }};
}

}  // namespace cairn::app
