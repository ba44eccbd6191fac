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

#include "arguments.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/io/losses_not_written.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/map_check.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/selection_check.hpp"
#include "cairn/policy/threshold_search.hpp"
#include "cairn/policy/uncertainty_comparison.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/sparsification/whole_map.hpp"
#include "commands.hpp"
#include "compact.hpp"
#include "compact_report.hpp"
#include "graph_files.hpp"
#include "interrupt.hpp"
#include "problem_setup.hpp"
#include "progress.hpp"
#include "results.hpp"
#include "table.hpp"
#include "threshold_files.hpp"
#include "used_thresholds.hpp"

namespace cairn::app {
namespace {

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

constexpr std::string_view kWhole = "whole";

/// What to run, and the thresholds.
struct Job {
  PolicyJob job;
  FoundThresholds found = {};  ///< or read
  UsedThresholds thresholds = {};
  std::string strategy = {};  ///< empty: the policy has none
  std::int64_t sample = 0;    ///< poses in which the thresholds were found
  OptionValues to_save = {};  ///< thresholds for another run
  bool is_whole() const { return strategy == kWhole; }
};

/// So many poses from the first on: a sample without loop closures would tell nothing.
std::size_t sample_size(const CompactOptions& options, const PolicyData& data,
                        const Session& session) {
  const auto [asked, count] = threshold_sample(data, options.sample);
  if (count != asked) {
    session.note(
        fmt::format("the first {} poses have too few loop closures to find thresholds: the sample "
                    "is {} of {} poses",
                    asked, count, data.poses.size()));
  }
  return count;
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

/// The strategy of a run: that wanted, or what the policy's own options say; empty: it has none.
std::string strategy_of(const CompactOptions& options, const std::string& wanted,
                        const ComponentSpec& policy, const OptionTable& table) {
  if (!table.find("strategy")) {
    if (!options.strategy.empty())
      throw Error(ErrorCode::usage, fmt::format("policy '{}' has no strategies", policy.name));
    return {};
  }
  const auto own = policy.values.find("strategy");
  if (own == policy.values.end()) return wanted;
  if (!options.strategy.empty() && own->second != options.strategy)
    throw Error(ErrorCode::usage, "--strategy, and strategy among the policy's options: give one");
  return own->second;
}

/// Of a whole map and of one at random the policy chooses how many poses, or which.
std::string strategy_of_policy(const std::string& strategy) {
  return strategy == kWhole || strategy == "rfpfl" ? "fpfl" : strategy;
}

Job prepare(const CompactOptions& options, const std::string& strategy,
            const PolicySetting& setting, const Session& session) {
  Job result;
  PolicyJob& job = result.job;
  job.registration = options.registration;
  if (strategy == "rfpfl") {
    if (setting.data.landmarks > 0) {
      throw Error(
          ErrorCode::usage,
          fmt::format("--strategy rfpfl draws poses and loop closures, and the graph has {}, "
                      "which it does not take: give --strategy apal, apfl or fpfl, or leave "
                      "the landmarks and what is measured of them out of the graph",
                      plural(setting.data.landmarks, "landmark")));
    }
    // The control draws from what was recorded, so the policy has no more to choose from.
    ComponentSpec registration = parse_component(options.registration);
    if (registration.name == "recorded") registration.values.emplace("carry", "0");
    job.registration = spec_text(registration);
  }
  job.policy = parse_component(options.policy);
  const auto emplace = [&](const OptionValues& values) {
    for (const auto& [name, value] : values) job.policy.values.emplace(name, value);
  };
  bool automatic = options.automatic || (!names_thresholds(options, job.policy) &&
                                         finds_thresholds(job.policy, setting.registry));
  if (automatic && !options.automatic && setting.data.loops == 0 && setting.data.observations > 0) {
    automatic = false;
    session.note(
        "there are landmarks and no loop closures between poses, in which to find thresholds: "
        "those of the policy's defaults are used");
  }
  emplace(given_thresholds(options));
  const OptionValues given = job.policy.values;
  if (!options.estimator.empty()) emplace({{"estimator", options.estimator}});
  const OptionTable& table = setting.registry.options(PosePolicy::kKind, job.policy.name);
  result.strategy = strategy_of(options, strategy, job.policy, table);
  if (!options.thresholds.empty()) {
    SavedThresholds saved = read_thresholds(options.thresholds, job.policy.name);
    result.found.options = std::move(saved.options);
    result.sample = saved.poses;
  }
  if (automatic) {
    const std::size_t count = sample_size(options, setting.data, session);
    result.sample = static_cast<std::int64_t>(count);
    // The error of a whole map does not depend on which loop closures the policy uses: thresholds
    // are lowered for another run alone.
    if (result.is_whole() && !options.save_thresholds.empty()) {
      const FoundThresholds others = find_thresholds(job, count, options.error_ratio, setting);
      result.to_save = used_thresholds(given, others.options, table).options;
    }
    result.found =
        find_thresholds(job, count, result.is_whole() ? 0.0 : options.error_ratio, setting);
    if (setting.interrupted()) return result;
  }
  if (!result.is_whole()) note_short_sample(result.sample, options, setting.data, session);
  emplace(result.found.options);
  result.thresholds = used_thresholds(given, result.found.options, table);
  if (result.to_save.empty()) result.to_save = result.thresholds.options;
  if (!given.empty()) result.sample = 0;
  // Not while thresholds are found, for which all measurements of the sample are used.
  if (options.keep > 0 &&
      !job.policy.values.emplace("keep", fmt::format("{}", options.keep)).second)
    throw Error(ErrorCode::usage, "--keep, and keep among the policy's options: give one");
  if (!result.strategy.empty()) emplace({{"strategy", strategy_of_policy(result.strategy)}});
  // The policy's own map is not kept, so that relocation costs nothing.
  if (result.is_whole() && table.find("reuse")) emplace({{"reuse", "true"}});
  return result;
}

void check(const CompactOptions& options, Session& session) {
  session.files.add_input(options.thresholds);
  session.files.add_input(options.map);
  check_output(options.output, options.output_format, session);
  check_output(options.trajectory, "", session, false);
  check_file(options.steps, session);
  check_file(options.compare, session);
  check_file(options.save_thresholds, session);
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
      replaceable_defaults(outcome.thresholds, strategy_of_policy(outcome.strategy));
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
  const bool automatic = outcome.found.seconds > 0.0;
  session.note(
      fmt::format("{}; {} {}", advice.finding,
                  option_words(advice.options, parse_component(options.policy).name, automatic),
                  advice.effect));
}

/// A user who asked for few poses and got all of them, or no loop closure, learns why, and what
/// would help.
void note_selection(const CompactOptions& options, const CompactOutcome& outcome,
                    Session& session) {
  const PolicyResult& result = outcome.result;
  if (strategy_of_policy(outcome.strategy) != "fpfl" || outcome.control) return;
  if (result.interrupted || !result.located) return;
  if (!finds_thresholds(parse_component(options.policy), session.registry())) return;
  SelectionCheck check;
  for (const PoseReport& pose : result.poses) check.add(pose);
  const bool automatic = outcome.found.seconds > 0.0;
  // A whole map has all loop closures, whichever the policy uses.
  const std::int64_t loops = outcome.whole ? 0 : outcome.data.loops;
  for (const SelectionCheck::Advice& advice :
       check.advice(automatic ? &outcome.found : nullptr, loops))
    note_advice(advice, options, outcome, session);
}

/// A map that is far from that of all measurements has lost more than its covariances say.
void note_distance(const CompactOptions& options, const CompactOutcome& outcome,
                   const Session& session) {
  if (outcome.whole) {
    if (outcome.whole->advice) note_advice(*outcome.whole->advice, options, outcome, session);
  } else if (outcome.check && outcome.check->is_far()) {
    session.note(fmt::format(
        "the map is {}: --strategy whole keeps as few poses with the estimate of all measurements, "
        "a lower --loop-gain uses more loop closures",
        outcome.check->to_string()));
  }
}

/// The strategy: `whole` by default, where it can be.
std::string choose_strategy(const CompactOptions& options, const Recording& recording,
                            const PolicySetting& setting) {
  if (!options.strategy.empty() && options.strategy != kWhole) return options.strategy;
  if (options.is_study) return "fpfl";
  const ComponentSpec policy = parse_component(options.policy);
  const bool has_strategies =
      setting.registry.options(PosePolicy::kKind, policy.name).find("strategy") != nullptr;
  if (options.strategy.empty() && (!has_strategies || policy.values.contains("strategy")))
    return "fpfl";  // or its own
  const std::string why_not =
      recording.map
          ? "the trajectory continues a map (--map)"
          : why_no_whole_map({.policy = {}, .registration = options.registration}, setting);
  if (why_not.empty()) return std::string(kWhole);
  if (options.strategy.empty()) return "fpfl";
  throw Error(ErrorCode::usage, fmt::format("--strategy {}: {}", kWhole, why_not));
}

/// For the strategy `whole`: the estimate of all measurements, without those that contradict the
/// others, which leave the recording. Nothing, and a note, where there is none.
std::optional<EstimateOfAll> estimate_all(Recording& recording, const PolicySetting& setting,
                                          const Session& session) {
  StatusLine line(session.common.quiet);
  if (line.on_terminal()) line.show("optimising all measurements");
  EstimateOfAll all = estimate_of_all(setting);
  line.clear();
  if (!all.why_not.empty()) {
    if (!setting.interrupted())
      session.note(fmt::format("the map is that of --strategy fpfl: {}", all.why_not));
    return std::nullopt;
  }
  if (const std::string words = left_out_in_words(all, recording.data); !words.empty()) {
    session.note(words);
    recording.data = without_contradictions(std::move(recording.data), all);
  }
  return all;
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
  const PolicySetting setting{
      .data = recording.data,
      .registry = registry,
      .loss = setup.loss(),
      .loss_on = setup.loss_selector(),
      .interrupt = &guard.flag(),
      .progress = [&](std::string_view title, std::size_t count, const PolicyResult& counts) {
        progress.show(title, count, counts);
      }};
  Results results(session);
  const Recovery recovery = parse_enum<Recovery>(options.recovery, "--recovery");
  std::optional<UncertaintyComparison> comparison;
  if (!options.compare.empty())
    comparison.emplace(recording.data, registry.make<Estimator>("incremental_cholesky"));
  const auto run_job = [&](const PolicyJob& chosen, UncertaintyComparison* compare) {
    PolicyRun run(chosen, setting);
    if (recording.map) run.load(*recording.map);
    run.run(recording.data.poses.size(), chosen.policy.name, [&](std::size_t index) {
      if (compare) compare->add(index, run.policy());
    });
    progress.clear();
    return run.finish(recovery);
  };
  std::string strategy = choose_strategy(options, recording, setting);
  std::optional<EstimateOfAll> all;
  if (strategy == kWhole) {
    all = estimate_all(recording, setting, session);
    if (!all) strategy = "fpfl";
  }
  Job job = prepare(options, strategy, setting, session);
  if (guard.interrupted()) {
    progress.clear();
    session.note("interrupted before anything was selected");
    return kExitInterrupted;
  }
  PolicyResult result = run_job(job.job, comparison ? &*comparison : nullptr);
  std::optional<WholeMap> whole;
  if (job.is_whole()) {
    NodeProgress nodes(session.common.quiet);
    whole = take_whole_map(job.job, setting, *all, result,
                           [&](const SparsifyProgress& at) { nodes.show(at); });
    if (!whole->why_not.empty()) {
      session.note(fmt::format("the map is that of --strategy fpfl: {}", whole->why_not));
      whole.reset();
      job.strategy = "fpfl";
    }
  }
  results.write(options.save_thresholds, [&] {
    write_thresholds(options.save_thresholds, job.job.policy.name,
                     {.options = job.to_save, .poses = job.sample});
  });
  CompactOutcome outcome{.name = recording.name,
                         .strategy = job.strategy,
                         .data = recording.data,
                         .found = job.found,
                         .thresholds = job.thresholds,
                         .result = std::move(result),
                         .control = {},
                         .whole = std::move(whole)};
  if (all) {
    outcome.left_out = all->left_out_on;
    outcome.loops_left_out = all->loops_left_out;
  }
  if (options.strategy == "rfpfl") {
    PolicyJob random = job.job;
    random.policy = {"random_poses",
                     {{"poses", fmt::format("{}", outcome.result.kept_poses)},
                      {"loops", fmt::format("{}", outcome.result.kept_loops)},
                      {"draw", options.draw},
                      {"seed", fmt::format("{}", options.seed)}}};
    outcome.control = run_job(random, nullptr);
  }
  const PolicyResult& shown = outcome.shown();
  outcome.check = outcome.whole ? outcome.whole->check : check_map(job.job, shown, setting);
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
                [&] { write_file(options.compare, comparison_csv(comparison->steps())); });
  results.add([&] {
    boost::json::object report = report_json(options, outcome);
    if (comparison) report["compare"] = comparison_json(comparison->steps());
    session.write_json(report);
  });
  note_defaults(options, outcome, session);
  note_selection(options, outcome, session);
  note_distance(options, outcome, session);
  if (outcome.whole) {
    for (const std::string& note : outcome.whole->notes) session.note(note);
  }
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

void add_compact_options(ArgumentParser cli, CompactOptions& options,
                         std::vector<std::string> strategies) {
  cli.add_option("graph", options.graph, kGraphHelp)
      .type_name("GRAPH")
      .file_or_generated({"generator"})
      .required();
  cli.add_option("-o,--output", options.output, "write the compact graph").type_name("OUT");
  cli.add_option("--to", options.output_format, "format of OUT")
      .component({"format"})
      .type_name("FORMAT");
  cli.add_option("--trajectory", options.trajectory, "write all poses, those left out put back")
      .type_name("FILE");
  cli.add_option("--map", options.map,
                 "continue this map of an earlier session; where on it is unknown at first")
      .type_name("MAP");
  cli.add_option("--begin", options.begin,
                 "begin at the pose with this id; those before are of earlier sessions")
      .type_name("ID");
  cli.add_option(
         "--recovery", options.recovery,
         "put back what was left out: v0 evenly, v1 by distance, v2 along odometry, or likely")
      .type_name("HOW")
      .one_of({"v0", "v1", "v2", "likely"})
      .show_default();
  cli.add_option("--strategy", options.strategy,
                 "few poses with all measurements (whole), or as a robot drives, all or few poses "
                 "and loops: apal, apfl, fpfl [whole; fpfl with --map or another "
                 "registration]")
      .type_name("NAME")
      .one_of(std::move(strategies));
  cli.add_option("--policy", options.policy, "the pose policy, with options as NAME:key=value")
      .component({"pose_policy"})
      .show_default();
  cli.add_option("--estimator", options.estimator, "the estimator, instead of the policy's own")
      .component({"estimator"});
  cli.add_option("--registration", options.registration,
                 "matcher: recorded, or simulated:range=5,angle=1,false_rate=0.1")
      .component({"registration"})
      .show_default();
  cli.add_flag("--auto", options.automatic,
               "find those thresholds in a sample that are not given; the default if none are");
  cli.add_option("--sample", options.sample, "part of the poses that is the sample")
      .type_name("PART")
      .within(0.0, 1.0)
      .show_default();
  cli.add_option("--thresholds", options.thresholds, "take thresholds from a file")
      .type_name("FILE");
  cli.add_option("--save-thresholds", options.save_thresholds,
                 "write those given and found to a file")
      .type_name("FILE");
  cli.add_option("--range", options.range, "how far the sensor matches [m]").type_name("M");
  cli.add_option("--angle", options.angle, "and between which orientations [rad]").type_name("RAD");
  cli.add_option("--loop-gain", options.loop_gain,
                 "information gain that a loop closure must exceed [nats]")
      .type_name("G");
  cli.add_option("--pose-gain", options.pose_gain,
                 "a pose is kept if every link to one nearby would gain more [nats]")
      .type_name("G");
  cli.add_option("--gate", options.gate,
                 "reject loop closures beyond the chi-square quantile P of their innovation (0.99)")
      .type_name("P");
  cli.add_option("--keep", options.keep,
                 "keep so many poses at most: others leave, and are replaced by factors; 0: all")
      .type_name("N")
      .none_or_within(2, 1000000000)
      .show_default();
  cli.add_option("--truth", options.truth, "true poses, for errors").type_name("FILE");
  cli.add_option("--steps", options.steps, "a row for each pose, as CSV").type_name("FILE");
  add_loss_options(cli, options.problem);
  add_input_options(cli, options.input);
}

Command add_compact(ArgumentParser program) {
  auto options = std::make_shared<CompactOptions>();  // lives as long as the parser and the run
  ArgumentParser cli = program.add_command(
      "compact", "compact pose SLAM: keep only the most informative poses and loop closures");
  add_compact_options(cli, *options, {"whole", "apal", "apfl", "fpfl"});
  cli.footer(
      "Example:\n"
      "  cairn compact my.g2o -o compact.g2o --trajectory full.g2o --json report.json\n"
      "  cairn compact tuesday.g2o --map monday.g2o -o both.g2o --thresholds robot.json\n"
      "  cairn compact city.g2o --strategy apal --thresholds city.json --truth truth.g2o");
  return {cli, [options](Session& session) { return run_compact(*options, session); }};
}

}  // namespace cairn::app
