// SPDX-License-Identifier: BSD-3-Clause
// Compact pose SLAM on published and generated graphs, as in the tables of Ila et al. (2017).
#include <string>
#include <utility>

#include <fmt/format.h>

#include "compact_runs.hpp"
#include "json_access.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Words = std::vector<std::string>;

/// A run is given up after so many seconds, and repeated as long as all together take less than
/// this: the studies of `cairn compact` are to take half an hour.
constexpr double kLimit = 300.0, kEnough = 60.0;
/// Without a distance test a run is quadratic, and needed but once: its errors are always the same.
constexpr double kUntestedLimit = 1200.0;

/// All poses and every loop closure. Where the distance test loses none, that run is the same.
Contestant all_of_all(const Bench& bench, const DataSet& set, const Thresholds& thresholds,
                      const Contestant& tested) {
  Contestant all{.name = "apal",
                 .arguments = {"--strategy", "apal", "--policy", kAllLoops, "--thresholds",
                               thresholds.file.string()},
                 .limit = kUntestedLimit};
  if (!tested.runs.empty() &&
      number(tested.runs[0], "loops.kept") == number(tested.runs[0], "loops.in")) {
    all.runs = tested.runs;
    return all;
  }
  return run_seeds(bench, set, all, 1, [](int) { return Words(); });
}

/// Whether the graph is at the minimum that an optimiser finds from another initial estimate.
bool has_converged(const Bench& bench, const DataSet& set, const std::string& graph, double chi2) {
  const Run run =
      bench.cairn.optimize({set.name, graph, set.arguments}, {"--initial", "chordal"}, 1, 0.0);
  constexpr double kSame = 1e-6;
  return text(run.report, "status") == "converged" &&
         chi2 <= (1.0 + kSame) * number(run.report, "chi2.final") + kSame;
}

/// As many poses and loops as with the refined thresholds, drawn at random. How many of the runs
/// have converged is kept with them.
json::object measure_control(const Bench& bench, const TruthfulSet& truthful, const DataSet& set,
                             const Thresholds& thresholds, const std::string& name,
                             const std::string& draw) {
  const std::string graph = (bench.cairn.work() / "control.g2o").string();
  Contestant control{.name = name,
                     .arguments = {"--strategy", "rfpfl", "--draw", draw, "--thresholds",
                                   thresholds.file.string(), "-o", graph},
                     .limit = kLimit};
  int converged = 0;
  for (int seed = 1; seed <= (bench.quick ? 2 : 5) && control.in_time; ++seed) {
    Words arguments = control.arguments;
    arguments.insert(arguments.end(), {"--seed", fmt::format("{}", seed)});
    const Run run = run_compact(bench, set, arguments, control.limit);
    control.in_time = run.outcome.in_time;
    if (!control.in_time) break;
    control.runs.push_back(compact_summary(run.report));
    converged += has_converged(bench, truthful.set, graph, number(run.report, "chi2.final"));
  }
  json::object entry = control.entry();
  entry["converged"] = converged;
  return entry;
}

json::object measure_set(const Bench& bench, const TruthfulSet& truthful) {
  const DataSet set = with_truth(bench, truthful);
  const CompactThresholds thresholds = find_compact_thresholds(bench, set);
  std::vector<Contestant> contestants = compact_contestants(thresholds, kLimit, kEnough);
  run_rounds(
      bench.quick ? 1 : bench.rounds, contestants,
      [&](const Contestant& c) { return run_compact(bench, set, c.arguments, c.limit); },
      compact_summary);
  contestants.push_back(all_of_all(bench, set, thresholds.refined, contestants.front()));
  json::array entries = entries_of(contestants);
  for (const auto& [name, draw] : {std::pair{"random", "loops"}, {"random_poses", "poses"}})
    entries.push_back(measure_control(bench, truthful, set, thresholds.refined, name, draw));
  return {{"name", set.name},
          {"de_facto", truthful.truth == Truth::de_facto},
          {"refined", thresholds.refined.found},
          {"plain", thresholds.plain.found},
          {"by_rule", thresholds.by_rule.found},
          {"contestants", std::move(entries)}};
}

/// Everything as by default. What has a limit of time may have no run.
json::object measure_live(const Bench& bench, const LiveSet& live) {
  const DataSet set = with_truth(bench, live.set);
  Words sensor = live.sensor;
  json::object found;
  if (sensor.empty()) {
    const Thresholds thresholds = find_thresholds(bench, set, "live");
    sensor = {"--thresholds", thresholds.file.string()};
    found = thresholds.found;
  }
  const auto contestant = [&](const char* name, Words arguments) {
    return Contestant{.name = name, .arguments = std::move(arguments), .limit = kLimit};
  };
  const auto with = [&](const char* name, const char* strategy) {
    Words arguments = sensor;
    arguments.insert(arguments.end(), {"--strategy", strategy});
    return contestant(name, std::move(arguments));
  };
  json::array entries;
  for (const Contestant& one :
       {with("fpfl", "fpfl"), with("apal", "apal"),
        // No loop closure is used: what is left is odometry.
        contestant("odometry", {"--range", "0.001", "--angle", "0.001", "--loop-gain", "1e9"})})
    entries.push_back(run_seeds(bench, set, one, 1, [](int) { return Words(); }).entry());
  entries.push_back(
      run_seeds(bench, set, with("random", "rfpfl"), bench.quick ? 2 : 5, [](int seed) {
        return Words{"--seed", fmt::format("{}", seed)};
      }).entry());
  return {{"name", set.name},
          {"de_facto", live.set.truth == Truth::de_facto},
          {"thresholds", std::move(found)},
          {"contestants", std::move(entries)}};
}

/// All poses, and loops with a threshold on their gain alone: multiples of the rule's, and none.
json::object measure_gains(const Bench& bench, const TruthfulSet& truthful) {
  const DataSet set = with_truth(bench, truthful);
  const Thresholds rule =
      find_thresholds(bench, set, "gain", {"--error-ratio", "0", "--policy", kAsPublished});
  const double gain = std::stod(text(rule.found, "options.loop_gain"));
  const Words common{"--thresholds", rule.file.string()};
  const auto run = [&](const Words& more) {
    Words arguments = common;
    arguments.insert(arguments.end(), more.begin(), more.end());
    return compact_summary(run_compact(bench, set, arguments).report);
  };
  json::array runs;
  for (const double factor : {0.0, 0.125, 0.25, 0.5, 0.707, 1.0, 1.41, 2.0, 2.83, 4.0, 8.0}) {
    const double loop_gain = factor * gain;
    runs.push_back({{"factor", factor},
                    {"loop_gain", loop_gain},
                    {"run", run({"--strategy", "apfl", "--policy", kAsPublished, "--loop-gain",
                                 fmt::format("{}", loop_gain)})}});
  }
  return {{"name", set.name},
          {"apal", run({"--strategy", "apal", "--policy", kAllLoops})},
          {"runs", std::move(runs)}};
}

}  // namespace

void study_compact_gain(const Bench& bench, const Keep& keep) {
  for (const TruthfulSet& set : gain_sets(bench.data, bench.quick))
    attempt("compact, gains: " + set.set.name, [&] { keep(measure_gains(bench, set)); });
}

void study_compact_live(const Bench& bench, const Keep& keep) {
  for (const LiveSet& set : live_sets(bench.data, bench.quick))
    attempt("compact, live: " + set.set.set.name, [&] { keep(measure_live(bench, set)); });
}

void study_compact_sets(const Bench& bench, const Keep& keep) {
  for (const TruthfulSet& set : compact_sets(bench.data, bench.quick))
    attempt("compact: " + set.set.name, [&] { keep(measure_set(bench, set)); });
}

}  // namespace cairn::performance
