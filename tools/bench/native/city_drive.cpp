// SPDX-License-Identifier: BSD-3-Clause
// A robot that drives through a city beside `cairn online`, whose map has a fixed number of poses,
// and takes the time of each step: a front end whose sensor recognises every place within its
// range.
//
//   cairn_city_drive CAIRN CITY TRUTH KEEP SIGMA_T SIGMA_R SAMPLE FULL LIVE STOP...
//
// CITY has odometry, TRUTH the true poses. At each of the stops, which are numbers of poses, it
// waits for a line on standard input, drives on to there, and prints a line of JSON: the size of
// the map, times [s] and memory [bytes] since the last stop, and the map itself, rows of id, x, y
// and theta. Of the first SAMPLE poses FULL gets every measurement that was made, and LIVE each
// pose as it was estimated when it was the newest.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <map>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <boost/process/args.hpp>
#include <boost/process/child.hpp>
#include <boost/process/io.hpp>
#include <boost/process/pipe.hpp>

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kRange = 12.0;  // of the sensor, in any direction [m]

struct Pose {
  double x = 0.0, y = 0.0, theta = 0.0;  // [m, rad]
};

/// a · b.
Pose compose(const Pose& a, const Pose& b) {
  const double c = std::cos(a.theta), s = std::sin(a.theta);
  return {a.x + c * b.x - s * b.y, a.y + s * b.x + c * b.y,
          std::remainder(a.theta + b.theta, 2.0 * std::numbers::pi)};
}

/// a⁻¹ b.
Pose between(const Pose& a, const Pose& b) {
  const double c = std::cos(a.theta), s = std::sin(a.theta);
  const double x = b.x - a.x, y = b.y - a.y;
  return {c * x + s * y, c * y - s * x, std::remainder(b.theta - a.theta, 2.0 * std::numbers::pi)};
}

/// What the words of a line have after its tag and `ids` ids.
Pose pose_of(const std::string& line, int ids) {
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

std::vector<Pose> read_poses(const std::string& file, const std::string& tag, int ids) {
  std::ifstream in(file);
  std::vector<Pose> poses;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with(tag)) poses.push_back(pose_of(line, ids));
  }
  return poses;
}

/// The smallest value that a part of them does not exceed.
double percentile(std::vector<double> values, double part) {
  std::ranges::sort(values);
  const double rank = std::max(1.0, std::ceil(part * static_cast<double>(values.size())));
  return values.at(static_cast<std::size_t>(rank) - 1);
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return 0.5 * (values.at((values.size() - 1) / 2) + values.at(values.size() / 2));
}

struct Options {
  std::string cairn, city, truth;
  int keep = 0;
  double sigma_translation = 0.0, sigma_rotation = 0.0;  // of each axis
  int sample = 0;
  std::string full, live;
};

class Robot {
 public:
  explicit Robot(const Options& options)
      : options_(options),
        truth_(read_poses(options.truth, "VERTEX_SE2 ", 1)),
        odometry_(read_poses(options.city, "EDGE_SE2 ", 2)),
        full_(options.full),
        live_(options.live),
        online_(options.cairn,
                boost::process::args = {"online", "--policy",
                                        fmt::format("compact_pose:range={},angle=3.15,keep={}",
                                                    kRange, options.keep),
                                        "--threads", "1", "--quiet"},
                boost::process::std_in<to_, boost::process::std_out> from_) {
    if (truth_.empty() || truth_.size() != odometry_.size() + 1)
      throw std::runtime_error("the city and its truth have other poses");
  }

  void drive_to(int poses) {
    if (poses > std::ssize(truth_)) throw std::runtime_error("the city has fewer poses");
    for (; at_ < poses; ++at_) step();
    if (at_ >= options_.sample) {
      full_.close();
      live_.close();
    }
  }

  /// Of the steps since the last stop.
  void report() {
    std::vector<std::array<double, 4>> map;
    for (const auto& [id, pose] : map_now())
      map.push_back({static_cast<double>(id), pose.x, pose.y, pose.theta});
    const auto steps = static_cast<double>(seconds_.size());
    fmt::print(
        R"({{"poses": {}, "kept": {}, "factors": {}, "memory": {}, "median": {}, "p99": {}, )"
        R"("longest": {}, "asked": {}, "left": {}, "map": {}}})"
        "\n",
        at_, kept_, factors_, resident_memory(), median(seconds_), percentile(seconds_, 0.99),
        std::ranges::max(seconds_), asked_ / steps, left_ / steps, map);
    std::fflush(stdout);
    seconds_.clear();
    asked_ = left_ = 0.0;
  }

  int finish() {
    to_.close();
    to_.pipe().close();
    online_.wait();
    return online_.exit_code();
  }

 private:
  template <class Take>
  void ask(const std::string& lines, const Take& take) {
    to_ << lines << std::flush;
    for (std::string line; std::getline(from_, line);) {
      if (line.starts_with("ERROR")) throw std::runtime_error(line);
      if (line.starts_with("OK ")) return note_size(line);
      take(line);
    }
    throw std::runtime_error("cairn online has ended");
  }

  /// "OK 12 variables 5 factors 7 owed 0"
  void note_size(const std::string& line) {
    const std::size_t variables = line.find("variables "), factors = line.find("factors ");
    kept_ = std::stoi(line.substr(variables + 10));
    factors_ = std::stoi(line.substr(factors + 8));
  }

  /// The poses that are kept.
  std::map<int, Pose> map_now() {
    std::map<int, Pose> map;
    ask("ESTIMATE ALL\n", [&](const std::string& line) {
      if (line.starts_with("VERTEX_SE2 ")) map[std::stoi(line.substr(11))] = pose_of(line, 1);
    });
    if (!newest_kept_) map.erase(at_ - 1);
    return map;
  }

  /// Memory of `cairn online` [bytes].
  double resident_memory() {
    std::ifstream pages(fmt::format("/proc/{}/statm", online_.id()));
    double all = 0.0, resident = 0.0;
    pages >> all >> resident;
    return resident * static_cast<double>(::sysconf(_SC_PAGESIZE));
  }

  void step() {
    const auto begin = Clock::now();
    double elsewhere = 0.0;  // time of the sensor, and of what is written for batch
    std::string lines = fmt::format("NEW VERTEX_SE2 {}\n", at_);
    if (at_ > 0) lines += edge(at_ - 1, odometry_[static_cast<std::size_t>(at_) - 1]);
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
    std::string newest;
    ask("DONE\n", [&](const std::string& line) {
      if (line.starts_with("VERTEX_SE2 ")) newest = line;
      if (line.starts_with("REMOVED ")) ++left_;
      if (line.starts_with("KEPT ")) newest_kept_ = true;
      if (line.starts_with("DROPPED ")) newest_kept_ = false;
    });
    seconds_.push_back(std::chrono::duration<double>(Clock::now() - begin).count() - elsewhere);
    if (at_ < options_.sample) live_ << newest << '\n';
  }

  std::string edge(int from, const Pose& z) const {
    const double t = 1.0 / (options_.sigma_translation * options_.sigma_translation);
    const double r = 1.0 / (options_.sigma_rotation * options_.sigma_rotation);
    return fmt::format("EDGE_SE2 {} {} {} {} {} {} 0 0 {} 0 {}\n", from, at_, z.x, z.y, z.theta, t,
                       t, r);
  }

  std::string measure(int other) {
    ++asked_;
    const Pose motion =
        between(truth_[static_cast<std::size_t>(other)], truth_[static_cast<std::size_t>(at_)]);
    if (!(std::hypot(motion.x, motion.y) < kRange))
      return fmt::format("NOMATCH {} {}\n", other, at_);
    const double t = options_.sigma_translation;
    const Pose noise{t * normal_(random_), t * normal_(random_),
                     options_.sigma_rotation * normal_(random_)};
    const std::string line = edge(other, compose(motion, noise));
    record(line);
    return line;
  }

  void record(const std::string& lines) {
    if (at_ < options_.sample) full_ << lines;
  }

  Options options_;
  std::vector<Pose> truth_;
  std::vector<Pose> odometry_;  ///< to each pose but the first from the one before
  std::ofstream full_, live_;
  boost::process::opstream to_;
  boost::process::ipstream from_;
  boost::process::child online_;
  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
  int at_ = 0, kept_ = 0, factors_ = 0;
  bool newest_kept_ = true;
  double asked_ = 0.0, left_ = 0.0;
  std::vector<double> seconds_;
};

int run(const std::vector<std::string>& words) {
  constexpr std::size_t kFirstStop = 9;
  if (words.size() <= kFirstStop) {
    fmt::print(stderr,
               "cairn_city_drive CAIRN CITY TRUTH KEEP SIGMA_T SIGMA_R SAMPLE FULL LIVE STOP...\n");
    return 2;
  }
  std::signal(SIGPIPE, SIG_IGN);  // a program that has ended is an error of `ask`
  Robot robot({.cairn = words[0],
               .city = words[1],
               .truth = words[2],
               .keep = std::stoi(words[3]),
               .sigma_translation = std::stod(words[4]),
               .sigma_rotation = std::stod(words[5]),
               .sample = std::stoi(words[6]),
               .full = words[7],
               .live = words[8]});
  std::string go;
  for (std::size_t k = kFirstStop; k < words.size() && std::getline(std::cin, go); ++k) {
    robot.drive_to(std::stoi(words[k]));
    robot.report();
  }
  return robot.finish();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    fmt::print(stderr, "cairn_city_drive: {}\n", error.what());
    return 1;
  }
}
