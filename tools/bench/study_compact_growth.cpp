// SPDX-License-Identifier: BSD-3-Clause
// Compact pose SLAM of a robot that drives the same lap again and again.
#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "compact_runs.hpp"
#include "json_access.hpp"
#include "statistics.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

/// A strategy that takes longer is not tried on more laps.
constexpr double kLimit = 120.0, kEnough = 10.0;  // [s]

DataSet lap_set(int laps, const std::string& more = {}) {
  DataSet set = ellipse_n(laps, more);
  set.name += fmt::format(", {} lap{}", laps, laps == 1 ? "" : "s");
  return set;
}

void measure_growth(const Bench& bench, const std::vector<Contestant>& all, const Keep& keep) {
  std::vector<Contestant> left = all;
  const std::vector<int> laps =
      bench.quick ? std::vector{1, 2, 3} : std::vector{1, 2, 3, 5, 8, 10, 12, 15, 20, 25, 30};
  for (const int n : laps) {
    const DataSet set = lap_set(n);
    tell("compact, growth: " + set.name);
    std::vector<Contestant> contestants = left;
    run_rounds(
        bench.quick ? 1 : bench.rounds, contestants,
        [&](const Contestant& c) { return run_compact(bench, set, c.arguments, c.limit); },
        compact_summary);
    keep({{"part", "growth"}, {"laps", n}, {"contestants", entries_of(contestants)}});
    std::erase_if(left, [&](const Contestant& c) {
      return !std::ranges::any_of(
          contestants, [&](const Contestant& done) { return done.name == c.name && done.in_time; });
    });
  }
}

/// A row of what `cairn compact --steps` writes.
struct Step {
  double poses = 0.0, loops = 0.0;  ///< kept so far
  double seconds = 0.0;
};

std::vector<Step> read_steps(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line, cell;
  std::getline(in, line);
  std::vector<std::string> names;
  for (std::istringstream cells(line); std::getline(cells, cell, ',');) names.push_back(cell);
  const auto column = [&](const char* name) {
    const auto at = std::ranges::find(names, name);
    if (at == names.end()) throw std::runtime_error(fmt::format("steps without '{}'", name));
    return static_cast<std::size_t>(at - names.begin());
  };
  const std::size_t poses = column("poses"), loops = column("loops"), seconds = column("seconds");
  std::vector<Step> steps;
  while (std::getline(in, line)) {
    std::vector<std::string> row;
    for (std::istringstream cells(line); std::getline(cells, cell, ',');) row.push_back(cell);
    steps.push_back(
        {std::stod(row.at(poses)), std::stod(row.at(loops)), std::stod(row.at(seconds))});
  }
  return steps;
}

/// The fourth part of the steps that begins at `quarter` / 4 of them.
json::object times_of_quarter(const std::vector<Step>& steps, std::size_t quarter) {
  std::vector<double> seconds;
  for (std::size_t k = quarter * steps.size() / 4; k < (quarter + 1) * steps.size() / 4; ++k)
    seconds.push_back(steps[k].seconds);
  return {{"median", median(seconds)}, {"p99", percentile(seconds, 0.99)}};
}

/// A sensor that matches whatever is near, as long as the robot drives.
json::object measure_laps(const Bench& bench, const Contestant& contestant) {
  const int laps = bench.quick ? 20 : 200;
  const DataSet set = lap_set(laps, ",loop_density=0");
  tell(fmt::format("compact, growth: {}, simulated matches, {}", set.name, contestant.name));
  const std::filesystem::path file = bench.cairn.work() / "steps.csv";
  std::vector<std::string> arguments = contestant.arguments;
  arguments.insert(arguments.end(), {"--registration", std::string("simulated:") + kEllipseNSensor,
                                     "--steps", file.string()});
  const Run run = run_compact(bench, set, arguments, contestant.limit);
  json::object entry{{"part", "laps"},
                     {"name", contestant.name},
                     {"laps", laps},
                     {"in_time", run.outcome.in_time},
                     {"limit", contestant.limit}};
  if (!run.outcome.in_time) return entry;
  const std::vector<Step> steps = read_steps(file);
  json::array after;
  for (const int part : {20, 4, 2, 1}) {  // of 200 laps: 10, 50, 100, 200
    const Step& last = steps.at(steps.size() / static_cast<std::size_t>(part) - 1);
    after.push_back({{"laps", laps / part}, {"poses", last.poses}, {"loops", last.loops}});
  }
  entry["after"] = std::move(after);
  entry["first_quarter"] = times_of_quarter(steps, 0);
  entry["last_quarter"] = times_of_quarter(steps, 3);
  entry["run"] = compact_summary(run.report);
  return entry;
}

}  // namespace

void study_compact_growth(const Bench& bench, const Keep& keep) {
  const DataSet sample = lap_set(bench.quick ? 3 : 10);
  const CompactThresholds thresholds = find_compact_thresholds(bench, sample);
  keep({{"part", "thresholds"},
        {"refined", thresholds.refined.found},
        {"by_rule", thresholds.by_rule.found}});
  std::vector<Contestant> all = compact_contestants(thresholds, kLimit, kEnough);
  std::erase_if(all, [](const Contestant& c) { return c.name == "plain"; });
  measure_growth(bench, all, keep);
  for (const Contestant& contestant : all) {
    if (contestant.name != "tested") keep(measure_laps(bench, contestant));
  }
}

}  // namespace cairn::performance
