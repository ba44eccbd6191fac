// SPDX-License-Identifier: BSD-3-Clause
// cairn compact GRAPH: compact pose SLAM, which keeps the poses and loop closures that tell most.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <boost/json/object.hpp>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/io/losses_not_written.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/compaction.hpp"
#include "cairn/policy/map_check.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/saved_thresholds.hpp"
#include "cairn/policy/selection_check.hpp"
#include "cairn/policy/threshold_search.hpp"
#include "cairn/policy/uncertainty_comparison.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/json_text.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "compact.hpp"
#include "compact_report.hpp"
#include "used_thresholds.hpp"

namespace cairn::app {
namespace {

void write_thresholds(const std::string& file, const std::string& policy,
                      const SavedThresholds& thresholds) {
  boost::json::object options;
  for (const auto& [name, value] : thresholds.options) options[name] = value;
  boost::json::object all{{"policy", policy}, {"options", std::move(options)}};
  if (thresholds.poses > 0) all["poses"] = thresholds.poses;
  write_file(file, json_text(all) + "\n");
}

// Input -------------------------------------------------------------------------------------------

struct Recording {
  std::string name;
  PolicyData data;
  std::optional<Graph> map;  ///< that the trajectory continues
};

Recording load_recording(const CompactOptions& options, Session& session) {
  LoadedGraph loaded = load_graph(options.graph, options.input, session);
  if (!options.truth.empty())
    loaded.truth = load_ground_truth(options.truth, options.input, session).graph;
  std::optional<Graph> map;
  if (!options.map.empty()) map = load_graph(options.map, options.input, session).graph;
  const Gaps gaps = map ? Gaps::refuse : Gaps::bridge;
  Recording recording{
      loaded.name,
      policy_data(std::move(loaded.graph), std::move(loaded.truth), options.begin, gaps),
      std::move(map)};
  if (const std::string bridged = to_string(recording.data.gaps); !bridged.empty())
    session.note(bridged);
  return recording;
}

/// Where a trajectory begins on a map is not known, whatever its first pose says.
void note_fixed_start(const Recording& recording, const Session& session) {
  const PolicyData& data = recording.data;
  if (!recording.map || data.poses.empty()) return;
  const int first = data.poses.front().pose();
  if (!data.recording.fixed(first)) return;
  session.note(fmt::format("{} is not fixed: where it is on the map is found by matches",
                           data.recording.describe_variable(first)));
}

/// A measurement of a pose of an earlier session that the map has not kept can be carried over to
/// one that it has by odometry of that session alone, which a recording may lack.
void note_lost_measurements(const Recording& recording, const CompactOptions& options,
                            const Session& session) {
  const PolicyData& data = recording.data;
  if (!recording.map || data.poses.empty() || !options.registration.starts_with("recorded")) return;
  const Graph& graph = data.recording;
  const Id first = graph.id(data.poses.front().pose());
  const auto earlier = [&](int v) { return !is_point(graph.type(v)) && graph.id(v) < first; };
  std::vector<bool> led_to(graph.variable_count());  // by a measurement of an earlier session
  for (int f = 0; f < graph.factor_count(); ++f) {
    const auto on = graph.factor_variables(f);
    if (on.size() != 2 || !earlier(on[0]) || !earlier(on[1])) continue;
    led_to[on[0]] = led_to[on[1]] = true;
  }
  int between = 0, lost = 0;
  for (const Arrival& arrival : data.poses) {
    for (const int f : arrival.links) {
      for (const int v : graph.factor_variables(f)) {
        if (!earlier(v)) continue;
        ++between;
        lost += !led_to[v] && !recording.map->find(graph.id(v));
      }
    }
  }
  if (lost == 0) return;
  session.note(fmt::format(
      "{} of {} measurements between the sessions are lost: they are of poses that {} has not "
      "kept, and {} has no odometry of the earlier session to carry them over to others; give a "
      "recording that has it as well, and --begin {}",
      lost, between, options.map, recording.name, first));
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
         !options.thresholds.empty() || gives_thresholds(policy);
}

/// What to run, and the thresholds.
struct Job {
  CompactionJob compaction;
  OptionValues given = {};  ///< of the policy, on the command line
  std::int64_t sample = 0;  ///< poses in which thresholds that are read were found
};

/// In how many poses the thresholds of a run were found; 0: not known, or not found.
std::int64_t sample_of(const Job& job, const Compaction& made) {
  return made.sample.count > 0 ? static_cast<std::int64_t>(made.sample.count) : job.sample;
}

/// What thresholds allow was checked for a run as long as their sample.
void note_short_sample(std::int64_t sample, const CompactOptions& options, const PolicyData& data,
                       const Session& session) {
  constexpr std::int64_t kLonger = 2;  // times
  if (sample == 0 || options.loop_gain || std::ssize(data.poses) / kLonger <= sample) return;
  session.note(fmt::format(
      "the thresholds were found in {} poses, and this recording has {}: the error of a map grows "
      "with its size, and with these thresholds may be several times that of all measurements. {}, "
      "or give a lower --loop-gain",
      sample, data.poses.size(),
      options.thresholds.empty() ? "Take a larger --sample"
                                 : "Find them here, without --thresholds"));
}

/// The strategy of the policy that was run: of a whole map it chooses how many poses.
std::string strategy_of_policy(const std::string& strategy) {
  return strategy == kWholeStrategy ? "fpfl" : strategy;
}

/// A study is of what a robot would do, and a control of as many poses and loops.
std::string strategy_asked_for(const CompactOptions& options, const ComponentSpec& policy,
                               const OptionTable& table) {
  if (options.strategy == "rfpfl") return "fpfl";
  const bool open = table.find("strategy") && !policy.values.contains("strategy");
  return options.strategy.empty() && options.is_study && open ? "fpfl" : options.strategy;
}

Job prepare(const CompactOptions& options, const Recording& recording, Session& session) {
  const PolicyData& data = recording.data;
  Job result;
  CompactionJob& job = result.compaction;
  job.job.registration = options.registration;
  if (options.strategy == "rfpfl") {
    if (data.landmarks > 0) {
      throw Error(
          ErrorCode::usage,
          fmt::format("--strategy rfpfl draws poses and loop closures, and the graph has {}, "
                      "which it does not take: give --strategy apal, apfl or fpfl, or leave "
                      "the landmarks and what is measured of them out of the graph",
                      plural(data.landmarks, "landmark")));
    }
    // The control draws from what was recorded, so the policy has no more to choose from.
    ComponentSpec registration = parse_component(options.registration);
    if (registration.name == "recorded") registration.values.emplace("carry", "0");
    job.job.registration = spec_text(registration);
  }
  ComponentSpec& policy = job.job.policy = parse_component(options.policy);
  if (options.automatic) {
    job.find = true;
  } else if (names_thresholds(options, policy)) {
    job.find = false;
  }
  for (const auto& [name, value] : given_thresholds(options)) policy.values.emplace(name, value);
  result.given = policy.values;
  if (!options.estimator.empty()) policy.values.emplace("estimator", options.estimator);
  if (!options.thresholds.empty()) {
    SavedThresholds saved = read_thresholds(options.thresholds, policy.name);
    job.thresholds = std::move(saved.options);
    result.sample = saved.poses;
  }
  job.strategy = strategy_asked_for(options, policy,
                                    session.registry().options(PosePolicy::kKind, policy.name));
  job.sample = options.sample;
  job.error_ratio = options.error_ratio;
  job.keep = options.keep;
  job.recovery = parse_enum<Recovery>(options.recovery, "--recovery");
  job.map = recording.map ? &*recording.map : nullptr;
  return result;
}

/// Thresholds for another run, which need not be `whole`: where they were found by the rule alone,
/// they are found again with the errors of such a run in mind.
SavedThresholds thresholds_to_save(const CompactOptions& options, const Job& job,
                                   const Compaction& made, const UsedThresholds& used,
                                   const PolicySetting& setting) {
  SavedThresholds saved{.options = used.options,
                        .poses = job.given.empty() ? sample_of(job, made) : 0};
  if (made.found.options.empty() || !made.found.trials.empty() || options.error_ratio <= 0.0)
    return saved;
  PolicyJob other{.policy = parse_component(options.policy), .registration = options.registration};
  other.policy.values = job.given;
  const FoundThresholds found =
      find_thresholds(other, made.sample.count, options.error_ratio, setting);
  saved.options = used_thresholds(job.given, found.options,
                                  setting.registry.options(PosePolicy::kKind, other.policy.name))
                      .options;
  return saved;
}

void check(const CompactOptions& options, Session& session) {
  session.files.add_input(options.thresholds);
  session.files.add_input(options.map);
  check_output(options.output, options.output_format, session);
  check_output(options.trajectory, "", session, false);
  check_file(options.steps, session);
  check_file(options.compare, session);
  check_file(options.save_thresholds, session);
  options.figures.check(session);
  if (!options.compare.empty() && !options.map.empty()) {
    throw Error(ErrorCode::usage,
                "--compare is with all measurements of a recording, which a map of an earlier "
                "session does not have: give one of --compare and --map");
  }
  if (options.automatic && !options.thresholds.empty())
    throw Error(ErrorCode::usage, "--auto finds thresholds, --thresholds reads them: give one");
}

/// One threshold that is given leaves the others at values that know nothing of the data.
void note_defaults(const CompactOptions& options, const CompactOutcome& outcome, Session& session) {
  if (!finds_thresholds(parse_component(options.policy), session.registry())) return;
  const std::string defaults =
      replaceable_defaults(outcome.thresholds, strategy_of_policy(outcome.made.strategy));
  if (defaults.empty() || outcome.data.loops == 0) return;  // or a search would find none
  session.note(
      fmt::format("some thresholds are given, so no others were looked for: of {} the policy's "
                  "defaults are used, whatever the sensor and the data; --auto finds them",
                  defaults));
}

/// The options by their names on the command line. One that is given stops the search of the others
/// unless `--auto` asks for it.
std::string option_words(const OptionValues& options, const std::string& policy, bool automatic) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kNames{
      {{"range", "--range"},
       {"angle", "--angle"},
       {"loop_gain", "--loop-gain"},
       {"pose_gain", "--pose-gain"},
       {"gate", "--gate"}}};
  std::string words;
  for (const auto& [option, value] : options) {
    const auto* const known =
        std::ranges::find(kNames, option, [](const auto& n) { return n.first; });
    if (!words.empty()) words += value.empty() ? " and " : " ";
    if (known == kNames.end()) {
      words += fmt::format("--policy {}:{}={}", policy, option, value);
    } else if (value.empty()) {
      words += fmt::format("a larger {}", known->second);
    } else {
      words += fmt::format("{} {}", known->second, value);
    }
  }
  return automatic && !words.starts_with("a ") ? "--auto " + words : words;
}

void note_advice(const SelectionCheck::Advice& advice, const CompactOptions& options,
                 const CompactOutcome& outcome, const Session& session) {
  const bool automatic = outcome.made.found.seconds > 0.0;
  session.note(
      fmt::format("{}; {} {}", advice.finding,
                  option_words(advice.options, parse_component(options.policy).name, automatic),
                  advice.effect));
}

/// A map that is far from that of all measurements has lost more than its covariances say.
void note_distance(const CompactOutcome& outcome, const Session& session) {
  if (outcome.made.whole || !outcome.made.check || !outcome.made.check->is_far()) return;
  session.note(fmt::format(
      "the map is {}: --strategy whole keeps as few poses with the estimate of all measurements, "
      "a lower --loop-gain uses more loop closures",
      outcome.made.check->to_string()));
}

}  // namespace

int run_compact(const CompactOptions& options, Session& session) {
  check(options, session);
  session.use_threads();
  Registry& registry = session.registry();
  const ProblemSetup setup(options.problem, registry);
  Recording recording = load_recording(options, session);
  note_fixed_start(recording, session);
  note_lost_measurements(recording, options, session);
  const InterruptGuard guard;  // until the results are written
  PolicyProgress progress(session.common.quiet);
  WorkProgress nodes(session.common.quiet);
  StatusLine line(session.common.quiet);
  const PolicySetting setting{
      .data = recording.data,
      .registry = registry,
      .loss = setup.loss(),
      .loss_on = setup.loss_selector(),
      .interrupt = &guard.flag(),
      .progress = [&](std::string_view title, std::size_t count, const PolicyResult& counts) {
        progress.show(title, count, counts);
      }};
  Results results;
  const Job job = prepare(options, recording, session);
  std::optional<UncertaintyComparison> comparison;
  if (!options.compare.empty())
    comparison.emplace(recording.data, registry.make<Estimator>("incremental_cholesky"));
  Compaction made = compact_recording(job.compaction, recording.data, setting,
                                      {.note =
                                           [&](const std::string& sentence) {
                                             progress.clear();
                                             session.note(sentence);
                                           },
                                       .optimising =
                                           [&](bool done) {
                                             if (done) line.clear();
                                             if (!done && line.on_terminal())
                                               line.show("optimising all measurements");
                                           },
                                       .pose =
                                           [&](std::size_t pose, PosePolicy& policy) {
                                             if (comparison) comparison->add(pose, policy);
                                           },
                                       .removing =
                                           [&](const SparsifyProgress& at) {
                                             progress.clear();
                                             nodes.show(at.part(), at.to_string());
                                           }});
  progress.clear();
  if (made.result.interrupted && made.result.poses.empty()) {
    session.note("interrupted before anything was selected");
    return kExitInterrupted;
  }
  if (options.strategy == "rfpfl") made.strategy = options.strategy;
  const std::string& policy = made.job.policy.name;
  const UsedThresholds thresholds = used_thresholds(
      job.given, made.found.options.empty() ? job.compaction.thresholds : made.found.options,
      registry.options(PosePolicy::kKind, policy));
  if (made.strategy != kWholeStrategy)
    note_short_sample(sample_of(job, made), options, recording.data, session);
  results.write(options.save_thresholds, [&] {
    write_thresholds(options.save_thresholds, policy,
                     thresholds_to_save(options, job, made, thresholds, setting));
  });
  CompactOutcome outcome{.name = recording.name,
                         .data = recording.data,
                         .thresholds = thresholds,
                         .made = std::move(made)};
  if (options.strategy == "rfpfl") {
    const PolicyResult& chosen = outcome.made.result;
    PolicyRun run({.policy = {"random_poses",
                              {{"poses", fmt::format("{}", chosen.kept_poses)},
                               {"loops", fmt::format("{}", chosen.kept_loops)},
                               {"draw", options.draw},
                               {"seed", fmt::format("{}", options.seed)}}},
                   .registration = outcome.made.job.registration},
                  setting);
    if (recording.map) run.load(*recording.map);
    run.run(recording.data.poses.size(), "random_poses");
    progress.clear();
    outcome.like = std::exchange(outcome.made.result, run.finish(job.compaction.recovery));
    outcome.made.check = check_map(outcome.made.job, outcome.made.result, setting);
  }
  const PolicyResult& shown = outcome.made.result;
  results.write(options.output, [&] {
    write_graph(shown.compact, options.output, registry,
                output_format(options.output, options.output_format));
    if (const std::string lost = losses_not_written(shown.compact); !lost.empty())
      session.note(lost);
  });
  results.write(options.trajectory, [&] {
    write_graph(shown.trajectory, options.trajectory, registry,
                output_format(options.trajectory, ""));
  });
  results.write(options.steps, [&] { write_file(options.steps, steps_csv(shown)); });
  results.write(options.compare,
                [&] { write_file(options.compare, csv_of<UncertaintyStep>(comparison->steps())); });
  results.add([&] {
    boost::json::object report = report_json(options, outcome);
    if (comparison) {
      boost::json::object& compared = report["compare"].emplace_object();
      compared["steps"] = comparison->steps().size();
      put(compared, conservativeness(comparison->steps()));
    }
    session.write_json(report);
  });
  options.figures.write(Figures(outcome.made), results);
  note_defaults(options, outcome, session);
  if (!outcome.like) {
    for (const SelectionCheck::Advice& advice : outcome.made.advice)
      note_advice(advice, options, outcome, session);
  }
  note_distance(outcome, session);
  results.add([&] { session.print(summary_text(options, outcome, results, session)); });
  results.finish();
  if (guard.interrupted()) return kExitInterrupted;
  for (const std::string& doubt : notes_on_estimate(shown.compact, chi2(shown.compact)).notes)
    session.note(doubt);
  if (!shown.located) {
    const auto waiting = shown.verdicts.find("waiting");
    const bool wait = waiting != shown.verdicts.end() && waiting->second > 0;
    session.note(fmt::format(
        "no pose was {} with one of {}: the map and the trajectory are not connected, and "
        "their relative position is unknown{}",
        wait ? "matched for certain" : "matched", options.map,
        wait ? fmt::format("; matches that wait for another which agrees: {} (--policy "
                           "compact_pose:trust=1 uses each that is consistent by itself)",
                           waiting->second)
             : ""));
    return static_cast<int>(ErrorCode::numerical);
  }
  if (shown.converged) return 0;
  session.note("the estimate of what was kept has not converged");
  return static_cast<int>(ErrorCode::numerical);
}

OptionFields<CompactOptions> CompactOptions::fields(std::vector<std::string> strategies,
                                                    std::string_view help) {
  using O = CompactOptions;
  constexpr double kAny = std::numeric_limits<double>::infinity();
  return OptionFields<O>()
      .text("graph", &O::graph, kGraphHelp)
      .positional()
      .placeholder("GRAPH")
      .or_generated_by({"generator"})
      .required()
      .text("output", &O::output, "write the compact graph")
      .letter('o')
      .placeholder("OUT")
      .component("to", &O::output_format, {"format"}, "format of OUT")
      .placeholder("FORMAT")
      .text("trajectory", &O::trajectory, "write all poses, those left out put back")
      .placeholder("FILE")
      .text("map", &O::map,
            "continue this map of an earlier session; where on it is unknown at first")
      .placeholder("MAP")
      .integer("begin", &O::begin, static_cast<double>(std::numeric_limits<Id>::min()),
               static_cast<double>(std::numeric_limits<Id>::max()),
               "begin at the pose with this id; those before are of earlier sessions")
      .placeholder("ID")
      .choice("recovery", &O::recovery, {"v0", "v1", "v2", "likely"},
              "put back what was left out: v0 evenly, v1 by distance, v2 along odometry, or likely")
      .placeholder("HOW")
      .choice("strategy", &O::strategy, std::move(strategies), help)
      .placeholder("NAME")
      .optional()
      .component("policy", &O::policy, {"pose_policy"},
                 "the pose policy, with options as NAME:key=value")
      .component("estimator", &O::estimator, {"estimator"},
                 "the estimator, instead of the policy's own")
      .component("registration", &O::registration, {"registration"},
                 "matcher: recorded, or simulated:range=5,angle=1,false_rate=0.1")
      .boolean("auto", &O::automatic,
               "find those thresholds in a sample that are not given; the default if none are")
      .real("sample", &O::sample, 0.0, 1.0, "part of the poses that is the sample")
      .placeholder("PART")
      .text("thresholds", &O::thresholds, "take thresholds from a file")
      .placeholder("FILE")
      .text("save_thresholds", &O::save_thresholds, "write those given and found to a file")
      .placeholder("FILE")
      .real("range", &O::range, -kAny, kAny, "how far the sensor matches [m]")
      .placeholder("M")
      .real("angle", &O::angle, -kAny, kAny, "and between which orientations [rad]")
      .placeholder("RAD")
      .real("loop_gain", &O::loop_gain, -kAny, kAny,
            "information gain that a loop closure must exceed [nats]")
      .placeholder("G")
      .real("pose_gain", &O::pose_gain, -kAny, kAny,
            "a pose is kept if every link to one nearby would gain more [nats]")
      .placeholder("G")
      .real("gate", &O::gate, -kAny, kAny,
            "reject loop closures beyond the chi-square quantile P of their innovation (0.99)")
      .placeholder("P")
      .integer("keep", &O::keep, 2, 1e9,
               "keep so many poses at most: others leave, and are replaced by factors; 0: all")
      .or_zero()
      .text("truth", &O::truth, "true poses, for errors")
      .placeholder("FILE")
      .text("steps", &O::steps, "a row for each pose, as CSV")
      .placeholder("FILE")
      .part(&O::figures)
      .part(&O::problem, ProblemOptions::loss_fields())
      .part(&O::input);
}

OptionFields<CompactOptions> CompactOptions::fields() {
  return fields({"whole", "apal", "apfl", "fpfl"},
                "few poses with all measurements (whole), or as a robot drives, all or few poses "
                "and loops: apal, apfl, fpfl [whole; fpfl with --map or another registration]");
}

void add_compact(Registrar& registrar) {
  add_command<CompactOptions>(
      registrar, "compact",
      "Example:\n"
      "  cairn compact my.g2o -o compact.g2o --trajectory full.g2o --json report.json\n"
      "  cairn compact tuesday.g2o --map monday.g2o -o both.g2o --thresholds robot.json\n"
      "  cairn compact city.g2o --strategy apal --thresholds city.json --truth truth.g2o",
      run_compact);
}

}  // namespace cairn::app
