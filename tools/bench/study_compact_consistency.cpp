// SPDX-License-Identifier: BSD-3-Clause
// Whether the covariances of compact pose SLAM are true, and what false matches do to it.
#include <fmt/format.h>

#include "compact_runs.hpp"
#include "json_access.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Words = std::vector<std::string>;

constexpr double kLimit = 120.0;  // of a run [s]
constexpr double kFalseRate = 0.1, kGate = 0.99;

/// The same drive with other noise each time, and thresholds from yet another.
json::object measure_errors(const Bench& bench, const Thresholds& thresholds,
                            const std::string& strategy) {
  Words arguments{"--strategy", strategy, "--thresholds", thresholds.file.string()};
  if (strategy == "apal") arguments.insert(arguments.end(), {"--policy", kAllLoops});
  const int runs = bench.quick ? 10 : 100;
  json::array all;
  for (int seed = 1; seed <= runs; ++seed) {
    const Run run = run_compact(bench, ellipse3d(fmt::format(",seed={}", seed)), arguments);
    all.push_back(*member(run.report, "nees"));
  }
  return {
      {"part", "nees"}, {"name", "ellipse3d"}, {"strategy", strategy}, {"runs", std::move(all)}};
}

/// At every step beside the system with everything.
json::object measure_comparison(const Bench& bench, const TruthfulSet& truthful) {
  const DataSet set = with_truth(bench, truthful);
  const Thresholds thresholds = find_thresholds(bench, set, "refined");
  const Run run = run_compact(bench, set,
                              {"--thresholds", thresholds.file.string(), "--compare",
                               (bench.cairn.work() / "compare.csv").string()});
  json::object entry{{"part", "compare"}, {"name", set.name}};
  entry["compare"] = *member(run.report, "compare");
  entry["run"] = compact_summary(run.report);
  return entry;
}

json::object measure_matches(const Bench& bench, const SimulatedSet& simulated) {
  const DataSet set = with_truth(bench, simulated.set);
  const std::string registration = "simulated:" + simulated.range;
  const Thresholds thresholds =
      find_thresholds(bench, set, "refined", {"--registration", registration});
  std::vector<Contestant> cases;
  for (const double false_rate : {0.0, kFalseRate}) {
    for (const bool gated : {false, true}) {
      Contestant one{.name = gated ? "gated" : "open",
                     .arguments = {"--thresholds", thresholds.file.string()},
                     .limit = kLimit};
      if (gated) one.arguments.insert(one.arguments.end(), {"--gate", fmt::format("{}", kGate)});
      one = run_seeds(bench, set, one, bench.quick ? 2 : 5, [&](int seed) {
        return Words{"--registration",
                     fmt::format("{},false_rate={},seed={}", registration, false_rate, seed)};
      });
      one.name += false_rate > 0.0 ? ", false" : ", clean";
      cases.push_back(std::move(one));
    }
  }
  return {{"name", set.name}, {"registration", registration},   {"false_rate", kFalseRate},
          {"gate", kGate},    {"thresholds", thresholds.found}, {"contestants", entries_of(cases)}};
}

}  // namespace

void study_compact_consistency(const Bench& bench, const Keep& keep) {
  tell("compact, consistency: normalised errors");
  const Thresholds thresholds = find_thresholds(bench, ellipse3d(",seed=1000"), "refined");
  for (const char* strategy : {"fpfl", "apal"}) keep(measure_errors(bench, thresholds, strategy));
  for (const TruthfulSet& set : comparison_sets(bench.data, bench.quick)) {
    attempt("compact, covariances: " + set.set.name, [&] { keep(measure_comparison(bench, set)); });
  }
}

void study_compact_matches(const Bench& bench, const Keep& keep) {
  for (const SimulatedSet& simulated : simulated_sets(bench.data, bench.quick)) {
    attempt("compact, false matches: " + simulated.set.set.name,
            [&] { keep(measure_matches(bench, simulated)); });
  }
}

}  // namespace cairn::performance
