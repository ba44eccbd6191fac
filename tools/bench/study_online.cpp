// SPDX-License-Identifier: BSD-3-Clause
// Graphs as they came about: the time of each step, and what chi2 is worth.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "json_access.hpp"
#include "rounds.hpp"
#include "statistics.hpp"
#include "studies.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;
using Words = std::vector<std::string>;

const std::string kOurs = "incremental_cholesky", kPeriodic = "periodic_batch", kBatch = "batch";

/// A replay is given up after so many seconds; `batch`, which takes the square of it, sooner.
constexpr double kLimit = 300.0, kLimitOfBatch = 60.0;
/// `batch` is not even tried on more variables.
constexpr double kMostVariablesOfBatch = 4000.0;
constexpr double kBudget = 0.005;  // [s]

Run replay(const Bench& bench, const DataSet& set, const Words& arguments, double limit) {
  Run run = bench.cairn.replay(set, arguments, 1, limit);
  if (run.report.is_null() && run.outcome.in_time) throw std::runtime_error(run.outcome.complaint);
  return run;
}

/// What the tables want of a run.
json::object summary(const json::value& report) {
  json::object all;
  for (const char* name : {"steps", "seconds", "owed", "failed_updates", "marginals_by", "checks",
                           "peak_memory_bytes"})
    all[name] = *member(report, name);
  all["chi2"] = number(report, "chi2.final");
  return all;
}

void replay_rounds(const Bench& bench, const DataSet& set, std::vector<Contestant>& contestants) {
  run_rounds(
      bench.quick ? 1 : bench.rounds, contestants,
      [&](const Contestant& c) { return replay(bench, set, c.arguments, c.limit); }, summary);
}

Words estimator(const std::string& name, Words more = {}) {
  more.insert(more.end(), {"--estimator", name});
  return more;
}

json::object begin_entry(const std::string& part, const DataSet& set,
                         const std::vector<Contestant>& contestants) {
  return {{"part", part},
          {"name", set.name},
          {"generated", set.generated()},
          {"contestants", entries_of(contestants)}};
}

// --- without covariances ---

json::object measure_times(const Bench& bench, const DataSet& set) {
  // Apart from the clock: what is optimised at the samples disturbs the caches.
  const std::string samples = bench.quick ? "10" : "50";
  const Run check = replay(bench, set, estimator(kOurs, {"--check", samples, "--finish"}), 0.0);
  std::vector<Contestant> contestants{
      {.name = kOurs, .arguments = estimator(kOurs), .limit = kLimit},
      {.name = kPeriodic, .arguments = estimator(kPeriodic), .limit = kLimit}};
  if (number(check.report, "graph.variables") <= kMostVariablesOfBatch) {
    contestants.push_back({.name = kBatch,
                           .arguments = estimator(kBatch),
                           .limit = bench.quick ? 10.0 : kLimitOfBatch});
  }
  replay_rounds(bench, set, contestants);
  json::object entry = begin_entry("times", set, contestants);
  entry["graph"] = *member(check.report, "graph");
  entry["checks"] = *member(check.report, "checks");
  return entry;
}

// --- with the estimate and all diagonal blocks ---

json::object measure_marginals(const Bench& bench, const DataSet& set) {
  const Words arguments = estimator(kOurs, {"--marginals", "diagonal", "--estimate"});
  std::vector<Contestant> contestants{{.name = kOurs, .arguments = arguments, .limit = kLimit}};
  replay_rounds(bench, set, contestants);
  return begin_entry("marginals", set, contestants);
}

// --- with a limit of time ---

/// `--check 1` compares after the last step, which disturbs nothing.
json::object measure_budget(const Bench& bench, const DataSet& set) {
  const Words with{"--check", "1", "--budget", fmt::format("{}", kBudget)};
  std::vector<Contestant> contestants{
      {.name = "none", .arguments = estimator(kOurs, {"--check", "1"}), .limit = kLimit},
      {.name = "budget", .arguments = estimator(kOurs, with), .limit = kLimit}};
  replay_rounds(bench, set, contestants);
  json::object entry = begin_entry("budget", set, contestants);
  entry["budget"] = kBudget;
  return entry;
}

// --- the picture ---

/// The fourth column of what `cairn replay --steps` writes.
std::vector<double> step_seconds(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<double> seconds;
  std::string line, cell;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    for (int k = 0; k < 4; ++k) std::getline(cells, cell, ',');
    seconds.push_back(std::stod(cell));
  }
  return seconds;
}

/// A point for so many steps, the longest of them, so that the picture stays small.
json::object measure_steps(const Bench& bench, const DataSet& set, const std::string& setting,
                           Words arguments) {
  constexpr std::size_t kPoints = 250;
  const std::filesystem::path file = bench.cairn.work() / "steps.csv";
  arguments.insert(arguments.end(), {"--steps", file.string()});
  replay(bench, set, arguments, 0.0);
  const std::vector<double> seconds = step_seconds(file);
  const std::size_t every = std::max<std::size_t>(1, seconds.size() / kPoints);
  json::array longest;
  for (auto some = seconds.begin(); seconds.end() - some >= std::ptrdiff_t(every);
       some += std::ptrdiff_t(every))
    longest.push_back(*std::max_element(some, some + std::ptrdiff_t(every)));
  return {{"part", "steps"},
          {"name", set.name},
          {"setting", setting},
          {"every", every},
          {"longest", std::move(longest)}};
}

}  // namespace

void study_online(const Bench& bench, const Keep& keep) {
  const std::vector<DataSet> sets = online_sets(bench.data, bench.quick);
  const std::vector<DataSet> limited = budget_sets(bench.data, bench.quick);
  for_each_set("online", sets, [&](const DataSet& set) { keep(measure_times(bench, set)); });
  for_each_set("online, covariances", sets,
               [&](const DataSet& set) { keep(measure_marginals(bench, set)); });
  for_each_set("online, budget", limited,
               [&](const DataSet& set) { keep(measure_budget(bench, set)); });
  for_each_set("online, steps", {sets.front()}, [&](const DataSet& set) {
    for (const std::string& name : {kOurs, kPeriodic})
      keep(measure_steps(bench, set, name, estimator(name)));
  });
  for_each_set("online, steps", {limited.front()}, [&](const DataSet& set) {
    keep(measure_steps(bench, set, kOurs, estimator(kOurs)));
    const Words with{"--budget", fmt::format("{}", kBudget)};
    keep(measure_steps(bench, set, fmt::format("at most {:.0f} ms", 1e3 * kBudget),
                       estimator(kOurs, with)));
  });
}

}  // namespace cairn::performance
