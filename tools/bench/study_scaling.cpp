// SPDX-License-Identifier: BSD-3-Clause
// Time and memory against size.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "json_access.hpp"
#include "statistics.hpp"
#include "studies.hpp"

namespace cairn::performance {
namespace {

namespace json = boost::json;

constexpr double kPatience = 300.0;  // seconds of one run
// Assumed until two sizes are known: beyond what any of these families shows.
constexpr double kFirstGuessOfGrowth = 2.0;
constexpr int kMillion = 1'000'000;

struct Family {
  const char* name;
  std::function<std::string(int poses)> graph;
};

std::array<Family, 3> families() {
  const auto of_poses = [](const char* kind) {
    return [kind](int poses) { return fmt::format("@{}:poses={}", kind, poses); };
  };
  const auto grid = [](int poses) {
    const long side = std::lround(std::cbrt(poses));
    return fmt::format("@grid3d:nx={0},ny={0},nz={0}", side);
  };
  return {Family{"manhattan", of_poses("manhattan")}, Family{"city", of_poses("city")},
          Family{"grid3d", grid}};
}

std::vector<int> sizes(bool quick) {
  if (quick) return {1000, 3000, 10000};
  return {1000, 3000, 10'000, 30'000, 100'000, 300'000, kMillion};
}

/// Large runs vary little, and take long. `seconds`: what one is expected to take.
int rounds_of(int poses, double seconds, int rounds) {
  constexpr double kLong = 60.0;
  if (poses <= 10'000) return rounds;
  return poses <= 100'000 && seconds < kLong ? std::min(rounds, 3) : 1;
}

/// What the next size will take, by the growth between the last two.
class Forecast {
 public:
  void add(double poses, double value) {
    if (poses_ > 0.0) growth_ = std::max(1.0, std::log(value / value_) / std::log(poses / poses_));
    poses_ = poses;
    value_ = value;
  }
  double at(double poses) const {
    return poses_ > 0.0 ? value_ * std::pow(poses / poses_, growth_) : 0.0;
  }

 private:
  double poses_ = 0.0, value_ = 0.0, growth_ = kFirstGuessOfGrowth;
};

json::object failed(json::object entry, const Run& run) {
  entry["left_out"] = run.outcome.in_time ? fmt::format("failed: {}", run.outcome.complaint.empty()
                                                                          ? "killed"
                                                                          : run.outcome.complaint)
                                          : fmt::format("not finished after {:.0f} s", kPatience);
  return entry;
}

/// The runs' medians, with what is the same in all of them.
json::object measure(const Bench& bench, const Family& family, int poses,
                     const std::vector<std::string>& arguments, int rounds) {
  json::object entry{{"family", family.name}, {"poses", poses}};
  std::vector<double> seconds, memory, whole;
  for (int round = 0; round < rounds; ++round) {
    const Run run =
        bench.cairn.optimize({family.name, family.graph(poses), {}}, arguments, 1, kPatience);
    if (!run.outcome.in_time || run.report.is_null()) return failed(std::move(entry), run);
    seconds.push_back(number(run.report, "seconds.total"));
    memory.push_back(number(run.report, "peak_memory_bytes"));
    whole.push_back(run.outcome.seconds);
    for (const char* name : {"graph", "solver", "status", "chi2", "initial"})
      entry[name] = *member(run.report, name);
    entry["iterations"] = list(run.report, "iterations").size();
  }
  entry["rounds"] = rounds;
  entry["seconds"] = median(seconds);
  entry["peak_memory_bytes"] = median(memory);
  entry["process_seconds"] = median(whole);  // generating and the first estimate too
  return entry;
}

void study_family(const Bench& bench, const Family& family, const Keep& keep) {
  Forecast time, memory;
  for (const int poses : sizes(bench.quick)) {
    const double seconds = time.at(poses), bytes = memory.at(poses);
    if (seconds > kPatience || bytes > allowed_memory()) {
      tell(fmt::format("scaling: {} of {} poses left out", family.name, poses));
      keep({{"family", family.name},
            {"poses", poses},
            {"left_out",
             fmt::format("would take about {:.0f} s and {:.0f} GB", seconds, bytes / 1e9)}});
      continue;
    }
    tell(fmt::format("scaling: {} of {} poses", family.name, poses));
    json::object entry = measure(bench, family, poses,
                                 {"--optimizer", "gauss_newton", "--linear-solver", bench.ours,
                                  "--iterations", "10", "--tolerance", "0"},
                                 rounds_of(poses, seconds, bench.rounds));
    entry["study"] = "ten iterations";
    if (!entry.contains("left_out")) {
      time.add(poses, number(entry, "seconds"));
      memory.add(poses, number(entry, "peak_memory_bytes"));
    }
    keep(std::move(entry));
  }
}

void study_convergence(const Bench& bench, const Family& family, const Keep& keep) {
  const int poses = bench.quick ? 10'000 : kMillion;
  tell(fmt::format("scaling: {} of {} poses, to convergence", family.name, poses));
  // From dead reckoning nothing converges over such a distance; the spanning tree costs next to
  // nothing, and its time is in that of the process.
  json::object entry = measure(bench, family, poses,
                               {"--initial", "spanning_tree", "--linear-solver", bench.ours}, 1);
  entry["study"] = "convergence";
  keep(std::move(entry));
}

}  // namespace

void study_scaling(const Bench& bench, const Keep& keep) {
  for (const Family& family : families()) study_family(bench, family, keep);
  study_convergence(bench, families().front(), keep);
}

}  // namespace cairn::performance
