// SPDX-License-Identifier: BSD-3-Clause
#include "compact_runs.hpp"

#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "camera_world.hpp"
#include "json_access.hpp"
#include "planar_truth.hpp"

namespace cairn::performance {
namespace {

namespace fs = std::filesystem;
namespace json = boost::json;
using Words = std::vector<std::string>;

std::string read(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

/// Optimises and writes what comes of it.
void optimize(const Bench& bench, DataSet set, const Words& more, const fs::path& out) {
  set.arguments.insert(set.arguments.end(), more.begin(), more.end());
  const Run run = bench.cairn.optimize(set, {"-o", out.string()}, 1, 0.0);
  if (text(run.report, "status") != "converged")
    throw std::runtime_error("no truth: " + run.outcome.complaint);
}

Words joined(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

}  // namespace

DataSet with_truth(const Bench& bench, const TruthfulSet& set) {
  DataSet with = set.set;
  if (set.truth == Truth::generated) return with;
  fs::create_directories(bench.cairn.work());
  const fs::path made = bench.cairn.work() / (with.name + "_truth.g2o");
  fs::path file = made;
  switch (set.truth) {
    case Truth::generated:
      break;
    case Truth::file:
      file = set.file;
      break;
    case Truth::camera:
      std::ofstream(made) << planar_truth(read(set.file));
      break;
    case Truth::simulated: {
      const CameraWorld world = camera_world(read(set.file), {});
      std::ofstream(made) << world.truth;
      with.graph = (bench.cairn.work() / (with.name + ".g2o")).string();
      std::ofstream(with.graph) << world.measurements;
      break;
    }
    case Truth::edges:
      optimize(bench, {with.name, set.file, with.arguments}, set.arguments, made);
      break;
    case Truth::de_facto:
      optimize(bench, with, set.arguments, made);
      break;
  }
  with.arguments = joined(with.arguments, {"--truth", file.string()});
  return with;
}

Run run_compact(const Bench& bench, const DataSet& set, const Words& arguments, double limit) {
  Run run = bench.cairn.compact(set, arguments, 1, limit);
  require_report(run);
  return run;
}

json::object compact_summary(const json::value& report) {
  json::object all;
  for (const char* name : {"poses", "loops", "verdicts", "seconds", "steps", "nonzeros", "errors",
                           "nees", "peak_memory_bytes"})
    all[name] = *member(report, name);
  all["chi2"] = number(report, "chi2.final");
  return all;
}

Thresholds find_thresholds(const Bench& bench, const DataSet& set, const std::string& name,
                           const Words& more) {
  Thresholds thresholds{bench.cairn.work() / (name + "_thresholds.json"), {}};
  fs::create_directories(bench.cairn.work());
  const Run run = run_compact(
      bench, set, joined({"--auto", "--save-thresholds", thresholds.file.string()}, more));
  thresholds.found = member(run.report, "thresholds")->as_object();
  return thresholds;
}

CompactThresholds find_compact_thresholds(const Bench& bench, const DataSet& set) {
  return {find_thresholds(bench, set, "refined"),
          find_thresholds(bench, set, "plain", {"--policy", kAsPublished}),
          find_thresholds(bench, set, "by_rule", {"--error-ratio", "0", "--policy", kAsPublished})};
}

std::vector<Contestant> compact_contestants(const CompactThresholds& thresholds, double limit,
                                            double enough) {
  const auto contestant = [&](const char* name, const char* strategy, const Thresholds& of,
                              const Words& more = {}) {
    return Contestant{
        .name = name,
        .arguments = joined({"--strategy", strategy, "--thresholds", of.file.string()}, more),
        .limit = limit,
        .enough = enough};
  };
  const Words published{"--policy", kAsPublished};
  return {contestant("tested", "apal", thresholds.refined),
          contestant("fpfl", "fpfl", thresholds.refined),
          contestant("plain", "fpfl", thresholds.plain, published),
          contestant("by_rule", "fpfl", thresholds.by_rule, published)};
}

Contestant run_seeds(const Bench& bench, const DataSet& set, Contestant contestant, int seeds,
                     const std::function<Words(int seed)>& seeded) {
  for (int seed = 1; seed <= seeds && contestant.in_time; ++seed) {
    const Run run =
        run_compact(bench, set, joined(contestant.arguments, seeded(seed)), contestant.limit);
    contestant.in_time = run.outcome.in_time;
    if (contestant.in_time) contestant.runs.push_back(compact_summary(run.report));
    contestant.spent += run.outcome.seconds;
  }
  return contestant;
}

}  // namespace cairn::performance
