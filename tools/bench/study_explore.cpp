// SPDX-License-Identifier: BSD-3-Clause
// Explorers on real floors, as in Tables 5.4 to 5.6 of Vallvé (2018) and beyond.
#include <algorithm>
#include <filesystem>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "json_access.hpp"
#include "studies.hpp"

namespace cairn::performance {
namespace {

namespace fs = std::filesystem;
namespace json = boost::json;
using Words = std::vector<std::string>;

/// A floor, by the name that tables give it.
struct Floor {
  std::string name, file;
};

/// The file of the data, or what is generated in its place.
Floor floor_of(const Bench& bench, const std::string& name, const std::string& generated) {
  const fs::path file = fs::path(bench.data) / "maps" / (name + ".yaml");
  if (!bench.data.empty() && fs::exists(file)) return {name, file.string()};
  return {generated, generated};
}

/// What is compared: the name that tables and the thesis's figures have, and the explorer.
struct Method {
  std::string name, explorer;
};

Words joined(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Seconds after which a method is given up on one floor, so that the whole takes an hour.
double limit(const Bench& bench) { return bench.quick ? 120.0 : 3600.0; }

/// Explorers without a plugin in this build are kept as missing.
bool is_on_offer(const Bench& bench, const std::string& explorer) {
  const std::vector<std::string> names = bench.cairn.names("explorer");
  return std::ranges::find(names, explorer.substr(0, explorer.find(':'))) != names.end();
}

/// One method on one floor, with some seeds.
json::object measure(const Bench& bench, const std::string& part, const Floor& floor,
                     const Method& method, int runs, const Words& settings) {
  json::object entry{
      {"part", part}, {"name", floor.name}, {"method", method.name}, {"explorer", method.explorer}};
  if (!is_on_offer(bench, method.explorer)) {
    tell(fmt::format("explore, {}: {} is not in this build: left out", part, method.explorer));
    entry["missing"] = true;
    return entry;
  }
  const int threads = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 2U));
  tell(fmt::format("explore, {}: {} on {}, {} runs", part, method.name, floor.name, runs));
  const fs::path curves = bench.cairn.work() / fmt::format("explore_{}_{}.csv", part, method.name);
  const Run run = bench.cairn.explore(floor.file,
                                      joined({"--explorer", method.explorer, "--runs",
                                              fmt::format("{}", runs), "--curves", curves.string()},
                                             settings),
                                      threads, limit(bench));
  entry["in_time"] = run.outcome.in_time;
  if (run.report.is_null()) {
    entry["error"] = run.outcome.in_time ? run.outcome.complaint : std::string("took too long");
    return entry;
  }
  json::object report = run.report.as_object();
  report.erase("curves");
  entry["report"] = std::move(report);
  return entry;
}

// The thesis's experiments
// --------------------------------------------------------------------------

/// What all of them have in common; the aperture, range and beams of the lidar are silent, and so
/// is `loop_gain`: docs/explore_results.md has where it is from.
const Words kThesis{"--policy",
                    "compact_pose:range=1,angle=0.35,reuse=false,gate=0.9999,loop_gain=6",
                    "--match", "range=1,angle=0.35,sigma_xy=0.05,sigma_theta=0.0017"};

/// E1 and E2 (5.3.3): noise per step.
Words configuration_space(const Bench& bench) {
  return joined(kThesis, {"--odometry", "sigma_xy=0.1,sigma_theta=0.0026,relative=0", "--lidar",
                          "fov=180,range=8,beams=181", "--until",
                          bench.quick ? "steps=30,decisions=15" : "steps=200,decisions=100"});
}

struct Lidar {
  double fov = 180;  // [deg], a beam each
  double range = 8;  // [m]
};

/// E3 (5.4.5): odometry's noise is 15 % of the motion, with a least one.
Words action_space(const Bench& bench, const Lidar& lidar = {}) {
  return joined(kThesis, {"--odometry", "relative=0.15,sigma_xy=0.01,sigma_theta=0.0052", "--lidar",
                          fmt::format("fov={},range={},beams={},range_sigma=0.05", lidar.fov,
                                      lidar.range, lidar.fov + 1),
                          "--until", bench.quick ? "distance=15" : "distance=250"});
}

/// The methods of the thesis, and beyond: frontiers by exact paths, and by chance.
const std::vector<Method> kConfigurationSpace{
    {"frontier", "frontier:length=0.5,smallest=0.1,keep=1,planner=rrt_star"},
    {"ede_gradient", "ede_gradient"},
    {"ede_rrt_star", "ede_rrt_star"},
    {"ours: frontier", "frontier"},
    {"ours: dopt", "dopt"}};
const std::vector<Method> kActionSpace{
    {"frontier", "frontier:length=0.9,keep=1,planner=rrt_star"},
    {"heuristic", "heuristic:keep=1,planner=rrt_star,entropy=thesis,revisits=0"},
    {"ede_rrt_star", "ede_rrt_star"},
    {"drrt_star", "drrt_star"},
    {"errt_star", "errt_star"},
    {"ours: frontier", "frontier"},
    {"ours: dopt", "dopt"},
    {"ours: random", "random"}};

void study_part(const Bench& bench, const Keep& keep, const std::string& part, const Floor& floor,
                const std::vector<Method>& methods, const Words& settings) {
  for (const Method& method : methods)
    keep(measure(bench, part, floor, method, bench.rounds, settings));
}

// All floors
// ----------------------------------------------------------------------------------------

const std::vector<std::string> kFloors{
    "cave_20m",       "fr079", "intel_lab", "hospital_40m", "willow_full",
    "stata_basement", "depot", "warehouse", "simple_rooms", "tb3_sandbox"};

std::vector<Floor> all_floors(const Bench& bench) {
  std::vector<Floor> floors;
  for (const std::string& name : kFloors) {
    const Floor floor = floor_of(bench, name, "");
    if (!floor.file.empty()) floors.push_back(floor);
  }
  if (floors.empty()) {
    for (const char* kind : {"@rooms", "@corridors", "@loop", "@cave"})
      floors.push_back({kind, kind});
  }
  if (bench.quick) floors.resize(std::min<std::size_t>(floors.size(), 2));
  return floors;
}

}  // namespace

void study_explore_cave(const Bench& bench, const Keep& keep) {
  study_part(bench, keep, "cave", floor_of(bench, "cave_20m", "@cave"), kConfigurationSpace,
             configuration_space(bench));
}

void study_explore_freiburg(const Bench& bench, const Keep& keep) {
  study_part(bench, keep, "freiburg", floor_of(bench, "fr079", "@corridors"), kConfigurationSpace,
             configuration_space(bench));
}

void study_explore_action(const Bench& bench, const Keep& keep) {
  study_part(bench, keep, "action", floor_of(bench, "fr079", "@rooms"), kActionSpace,
             action_space(bench));
}

void study_explore_scale(const Bench& bench, const Keep& keep) {
  study_part(bench, keep, "scale", floor_of(bench, "fr079_thesis_scale", "@rooms"), kActionSpace,
             action_space(bench));
}

void study_explore_floors(const Bench& bench, const Keep& keep) {
  constexpr int kSeeds = 2;
  const Words until{"--until", bench.quick ? "distance=10" : "distance=100"};
  for (const Floor& floor : all_floors(bench)) {
    for (const std::string& explorer : bench.cairn.names("explorer"))
      keep(measure(bench, "floors", floor, {explorer, explorer}, kSeeds, until));
    // Without noise and without a limit: all that can be reached is to be seen, and nothing hit.
    keep(measure(bench, "exact", floor, {"frontier", "frontier"}, 1,
                 joined({"--odometry", "sigma_xy=1e-6,sigma_theta=1e-6,relative=0", "--lidar",
                         "range_sigma=0"},
                        bench.quick ? until : Words())));
  }
}

void study_explore_sensitivity(const Bench& bench, const Keep& keep) {
  const Floor floor = floor_of(bench, "fr079", "@rooms");
  struct Change {
    std::string name;
    Lidar lidar;
    Words more;
  };
  const std::vector<Change> changes{
      {"as in Table 5.6", {}, {}},
      {"aperture 90°", {.fov = 90}, {}},
      {"aperture 270°", {.fov = 270}, {}},
      {"range 4 m", {.range = 4}, {}},
      {"range 16 m", {.range = 16}, {}},
      {"cells of 0.05 m", {}, {"--mapper", "log_odds:resolution=0.05"}},
      {"cells of 0.2 m", {}, {"--mapper", "log_odds:resolution=0.2"}}};
  for (const auto& [name, lidar, more] : changes) {
    for (const Method& method : {Method{"frontier", "frontier"}, {"drrt_star", "drrt_star"}}) {
      json::object entry = measure(bench, "sensitivity", floor, method, bench.rounds,
                                   joined(action_space(bench, lidar), more));
      entry["change"] = name;
      keep(std::move(entry));
    }
  }
}

}  // namespace cairn::performance
