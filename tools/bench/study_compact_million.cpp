// SPDX-License-Identifier: BSD-3-Clause
// A robot that drives through a city of 1 km² for a million poses, beside `cairn online`, whose map
// has a fixed number of poses.
#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <stdexcept>

#include <fmt/format.h>

#include "child_process.hpp"
#include "live_program.hpp"
#include "planar_error.hpp"
#include "statistics.hpp"
#include "studies.hpp"

namespace cairn::performance {
namespace {

namespace fs = std::filesystem;
namespace json = boost::json;
using Clock = std::chrono::steady_clock;

/// The noise of odometry and of matches, on each axis.
constexpr double kTranslation = 0.02, kRotation = 0.005;  // [m, rad]
constexpr double kRange = 12.0;                           // of the sensor, in any direction [m]

struct Drive {
  int poses = 1000000;
  int streets = 11;  ///< each way, 100 m apart
  int keep = 2000;
  int sample = 100000;  ///< so many are compared with batch
  std::vector<int> stops{1000, 10000, 100000, 200000, 500000, 1000000};
};

Drive drive_of(bool quick) {
  if (!quick) return {};
  return {.poses = 20000,
          .streets = 5,
          .keep = 300,
          .sample = 10000,
          .stops = {1000, 5000, 10000, 20000}};
}

/// What the words of a line have after its tag and `ids` ids.
PlanarPose pose_of(const std::string& line, int ids) {
  std::array<double, 3> numbers{};
  const char *at = line.data(), *end = line.data() + line.size();
  for (int skipped = 0; skipped <= ids; ++skipped) at = std::find(at, end, ' ') + 1;
  for (double& number : numbers) {
    const auto [after, problem] = std::from_chars(at, end, number);
    if (problem != std::errc{}) throw std::runtime_error("not a pose: " + line);
    at = after == end ? end : after + 1;
  }
  return {numbers[0], numbers[1], numbers[2]};
}

struct World {
  std::vector<PlanarPose> truth;
  std::vector<PlanarPose> odometry;  ///< to each pose from the one before
};

std::vector<PlanarPose> read_poses(const fs::path& file, const std::string& tag, int ids) {
  std::ifstream in(file);
  std::vector<PlanarPose> poses;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with(tag)) poses.push_back(pose_of(line, ids));
  }
  return poses;
}

World generate_world(const Bench& bench, const Drive& drive) {
  const fs::path city = bench.cairn.work() / "city.g2o", truth = bench.cairn.work() / "truth.g2o";
  const Outcome outcome = run_program(
      {bench.cairn.program().string(), "generate",
       fmt::format("manhattan:poses={},block=100,streets={},loop_density=0,translation_sigma={},"
                   "rotation_sigma={}",
                   drive.poses, drive.streets, kTranslation, kRotation),
       "-o", city.string(), "--ground-truth", truth.string(), "--quiet"},
      bench.cairn.work());
  if (outcome.exit_code != 0) throw std::runtime_error(outcome.complaint);
  World world{read_poses(truth, "VERTEX_SE2 ", 1), {{}}};
  const std::vector<PlanarPose> moved = read_poses(city, "EDGE_SE2 ", 2);
  world.odometry.insert(world.odometry.end(), moved.begin(), moved.end());
  fs::remove(city);
  fs::remove(truth);
  if (world.truth.size() != world.odometry.size() ||
      world.truth.size() != static_cast<std::size_t>(drive.poses))
    throw std::runtime_error("the city has other poses than were asked for");
  return world;
}

std::string edge(int from, int to, const PlanarPose& z) {
  constexpr double kT = 1.0 / (kTranslation * kTranslation), kR = 1.0 / (kRotation * kRotation);
  return fmt::format("EDGE_SE2 {} {} {} {} {} {} 0 0 {} 0 {}\n", from, to, z.x, z.y, z.theta, kT,
                     kT, kR);
}

/// A front end whose sensor recognises every place within its range, and the map that it has built.
class Robot {
 public:
  Robot(const Bench& bench, const World& world, const Drive& drive)
      : world_(world),
        sample_(drive.sample),
        full_file_(bench.cairn.work() / "full.g2o"),
        full_(full_file_),
        online_({bench.cairn.program().string(), "online", "--policy",
                 fmt::format("compact_pose:range={},angle=3.15,keep={}", kRange, drive.keep),
                 "--threads", "1", "--quiet"}) {}

  void drive_to(int poses) {
    for (; at_ < poses; ++at_) step();
  }

  /// Of the steps since the last stop.
  json::object stop() {
    std::vector<PlanarPose> map, truth;
    for (const auto& [id, pose] : map_now()) {
      map.push_back(pose);
      truth.push_back(world_.truth[static_cast<std::size_t>(id)]);
    }
    const PlanarError error = planar_error(map, truth);
    const auto steps = static_cast<double>(seconds_.size());
    json::object entry{{"part", "drive"},
                       {"poses", at_},
                       {"kept", kept_},
                       {"factors", factors_},
                       {"memory", online_.resident_memory()},
                       {"median", median(seconds_)},
                       {"p99", percentile(seconds_, 0.99)},
                       {"longest", *std::ranges::max_element(seconds_)},
                       {"asked", asked_ / steps},
                       {"left", left_ / steps},
                       {"ate", error.translation},
                       {"ate_rotation", error.rotation}};
    seconds_.clear();
    asked_ = left_ = 0.0;
    return entry;
  }

  /// The poses that are kept.
  std::map<int, PlanarPose> map_now() {
    std::map<int, PlanarPose> map;
    ask("ESTIMATE ALL\n", [&](const std::string& line) {
      if (line.starts_with("VERTEX_SE2 ")) map[std::stoi(line.substr(11))] = pose_of(line, 1);
    });
    if (!newest_kept_) map.erase(at_ - 1);
    return map;
  }

  /// As each pose was estimated when it was the newest.
  const std::vector<PlanarPose>& live() const { return live_; }
  /// All poses of the sample, with every measurement that was made.
  const fs::path& full_graph() {
    full_.close();
    return full_file_;
  }
  int finish() { return online_.finish(); }

 private:
  template <class Take>
  void ask(const std::string& lines, const Take& take) {
    online_.tell(lines);
    for (;;) {
      const std::string line = online_.answer();
      if (line.starts_with("ERROR")) throw std::runtime_error(line);
      if (line.starts_with("OK ")) return note_size(line);
      take(line);
    }
  }

  /// "OK 12 variables 5 factors 7 owed 0"
  void note_size(const std::string& line) {
    const std::size_t variables = line.find("variables "), factors = line.find("factors ");
    kept_ = std::stoi(line.substr(variables + 10));
    factors_ = std::stoi(line.substr(factors + 8));
  }

  void step() {
    const auto begin = Clock::now();
    double elsewhere = 0.0;  // time of the sensor, and of what is written for batch
    std::string lines = fmt::format("NEW VERTEX_SE2 {}\n", at_);
    if (at_ > 0) lines += edge(at_ - 1, at_, world_.odometry[static_cast<std::size_t>(at_)]);
    record(lines.substr(lines.find('\n') + 1));
    for (int match = 0; match >= 0;) {
      match = -1;
      ask(lines + "NEXT\n", [&](const std::string& line) {
        if (line.starts_with("MATCH ") && line[6] != 'N') match = std::stoi(line.substr(6));
      });
      const auto asked = Clock::now();
      if (match >= 0) lines = measure(match);
      elsewhere += std::chrono::duration<double>(Clock::now() - asked).count();
    }
    PlanarPose newest;
    ask("DONE\n", [&](const std::string& line) {
      if (line.starts_with("VERTEX_SE2 ")) newest = pose_of(line, 1);
      if (line.starts_with("REMOVED ")) ++left_;
      if (line.starts_with("KEPT ")) newest_kept_ = true;
      if (line.starts_with("DROPPED ")) newest_kept_ = false;
    });
    seconds_.push_back(std::chrono::duration<double>(Clock::now() - begin).count() - elsewhere);
    if (at_ < sample_) live_.push_back(newest);
  }

  std::string measure(int other) {
    ++asked_;
    const PlanarPose motion = between(world_.truth[static_cast<std::size_t>(other)],
                                      world_.truth[static_cast<std::size_t>(at_)]);
    if (!(std::hypot(motion.x, motion.y) < kRange))
      return fmt::format("NOMATCH {} {}\n", other, at_);
    const PlanarPose noise{kTranslation * normal_(random_), kTranslation * normal_(random_),
                           kRotation * normal_(random_)};
    const std::string line = edge(other, at_, compose(motion, noise));
    record(line);
    return line;
  }

  void record(const std::string& lines) {
    if (at_ < sample_) full_ << lines;
  }

  const World& world_;
  int sample_;
  fs::path full_file_;
  std::ofstream full_;
  LiveProgram online_;
  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
  int at_ = 0, kept_ = 0, factors_ = 0;
  bool newest_kept_ = true;
  double asked_ = 0.0, left_ = 0.0;
  std::vector<double> seconds_;
  std::vector<PlanarPose> live_;
};

/// Every pose of the sample where all measurements have it.
std::vector<PlanarPose> batch_solution(const Bench& bench, const fs::path& full, const World& world,
                                       int poses) {
  const fs::path given = bench.cairn.work() / "given.g2o", best = bench.cairn.work() / "best.g2o";
  {
    std::ofstream out(given);
    PlanarPose at = world.truth.front();
    for (int k = 0; k < poses; ++k) {
      if (k > 0) at = compose(at, world.odometry[static_cast<std::size_t>(k)]);
      out << fmt::format("VERTEX_SE2 {} {} {} {}\n", k, at.x, at.y, at.theta);
    }
    out << std::ifstream(full).rdbuf();
  }
  const Outcome outcome = run_program(
      {bench.cairn.program().string(), "optimize", given.string(), "-o", best.string(), "--quiet"},
      bench.cairn.work());
  if (outcome.exit_code != 0) throw std::runtime_error("batch: " + outcome.complaint);
  return read_poses(best, "VERTEX_SE2 ", 1);
}

json::object error_entry(const std::string& name, const std::vector<PlanarPose>& estimate,
                         const std::vector<PlanarPose>& truth) {
  const PlanarError error = planar_error(estimate, truth);
  return {{"part", "errors"},
          {"name", name},
          {"poses", estimate.size()},
          {"ate", error.translation},
          {"ate_rotation", error.rotation}};
}

void compare_with_batch(const Bench& bench, const World& world, Robot& robot, int sample,
                        const Keep& keep) {
  const std::map<int, PlanarPose> map = robot.map_now();
  const std::vector<PlanarPose> batch = batch_solution(bench, robot.full_graph(), world, sample);
  const auto first = [&](const std::vector<PlanarPose>& all) {
    return std::vector<PlanarPose>(all.begin(), all.begin() + sample);
  };
  const std::vector<PlanarPose> truth = first(world.truth);
  std::vector<PlanarPose> odometry{truth.front()};
  for (int k = 1; k < sample; ++k)
    odometry.push_back(compose(odometry.back(), world.odometry[static_cast<std::size_t>(k)]));
  std::vector<PlanarPose> kept, kept_truth, kept_batch;
  for (const auto& [id, pose] : map) {
    kept.push_back(pose);
    kept_truth.push_back(truth[static_cast<std::size_t>(id)]);
    kept_batch.push_back(batch[static_cast<std::size_t>(id)]);
  }
  keep(error_entry("odometry", odometry, truth));
  keep(error_entry("batch", batch, truth));
  keep(error_entry("live", robot.live(), truth));
  keep(error_entry("batch_at_kept", kept_batch, kept_truth));
  keep(error_entry("kept", kept, kept_truth));
}

}  // namespace

void study_compact_million(const Bench& bench, const Keep& keep) {
  const Drive drive = drive_of(bench.quick);
  fs::create_directories(bench.cairn.work());
  tell("compact, million: the city");
  const World world = generate_world(bench, drive);
  Robot robot(bench, world, drive);
  for (const int stop : drive.stops) {
    tell(fmt::format("compact, million: {} poses", stop));
    robot.drive_to(stop);
    keep(robot.stop());
    if (stop == drive.sample) compare_with_batch(bench, world, robot, drive.sample, keep);
  }
  if (robot.finish() != 0) throw std::runtime_error("cairn online has failed");
}

}  // namespace cairn::performance
