// SPDX-License-Identifier: BSD-3-Clause
// Logs of CARMEN (the Carnegie Mellon robot navigation toolkit): a message per line, of which
//
//     FLASER n r_1 … r_n x y theta odom_x odom_y odom_theta stamp host stamp
//
// is a scan of the front laser, from the right to the left. x, y, theta is where odometry has the
// laser; ODOM lines have the same for those who read them alone. Before a scan,
//
//     TRUEPOS true_x true_y true_theta odom_x odom_y odom_theta stamp host stamp
//
// is where a simulated robot truly was, and PARAM robot_front_laser_max how far the laser saw.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/exploration/scan_log.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::exploration {
namespace {

struct CarmenOptions {
  double range = 20.0, none = 80.0;

  static auto fields() {
    using O = CarmenOptions;
    return OptionFields<O>()
        .real("range", &O::range, 0.1, 1000.0,
              "how far the laser is trusted [m]: of longer ranges only that it is free so far")
        .real("none", &O::none, 0.1, 1000.0, "ranges from here on are no measurements [m]");
  }
};

constexpr int kMostReadings = 100000;
constexpr std::string_view kScan = "FLASER ", kTruth = "TRUEPOS ",
                           kRange = "PARAM robot_front_laser_max ";
/// What a laser of CARMEN returns where it has measured nothing, and more than it ever measures
/// [m].
constexpr double kNothing = 81.91, kLargest = 80.0;

/// Words of a line.
class Words {
 public:
  Words(std::string_view line, std::string where) : rest_(line), where_(std::move(where)) {}

  std::string_view next() {
    const std::size_t begin = rest_.find_first_not_of(" \t\r");
    if (begin == std::string_view::npos) return rest_ = {};
    rest_.remove_prefix(begin);
    const std::string_view word = rest_.substr(0, rest_.find_first_of(" \t\r"));
    rest_.remove_prefix(word.size());
    return word;
  }

  double number(std::string_view what) {
    const std::string_view word = next();
    double value = 0.0;
    const auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (word.empty()) fail(fmt::format("{} is missing", what));
    if (problem != std::errc{} || end != word.data() + word.size() || !std::isfinite(value))
      fail(fmt::format("'{}' is no finite number for {}", shortened(word), what));
    return value;
  }

  /// Of a pose: a number that leaves distances exact to a millimetre.
  double coordinate(std::string_view what) {
    constexpr double kFarthest = 1e9;
    const double value = number(what);
    if (std::abs(value) > kFarthest)
      fail(fmt::format("{} is {:g}, expected at most {:g}", what, value, kFarthest));
    return value;
  }

  [[noreturn]] void fail(const std::string& message) const {
    throw Error(ErrorCode::input, where_ + ": " + message);
  }

 private:
  static std::string_view shortened(std::string_view word) { return word.substr(0, 40); }

  std::string_view rest_;
  std::string where_;
};

class Carmen final : public ScanLogFormat {
 public:
  explicit Carmen(const CarmenOptions& options) : options_(options) {}

  std::vector<std::string> extensions() const override { return {"clf"}; }

  ScanLog read(std::string_view text, const std::string& name) override {
    ScanLog log;
    double range = options_.range;
    std::optional<Pose2> truth;
    for (std::size_t number = 1; !text.empty(); ++number) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      const std::string_view line = text.substr(0, end);
      const auto words = [&](std::string_view tag) {
        return Words(line.substr(tag.size()), fmt::format("{}:{}", name, number));
      };
      if (line.starts_with(kScan)) {
        log.scans.push_back(logged(words(kScan), range));
        if (truth) log.scans.back().truth.emplace(*truth);
        truth.reset();
      } else if (line.starts_with(kTruth)) {
        Words of_truth = words(kTruth);
        truth = pose(of_truth);
      } else if (line.starts_with(kRange)) {
        range = std::min(options_.range, largest_range(words(kRange)));
      }
      text.remove_prefix(std::min(end + 1, text.size()));
    }
    if (log.scans.empty()) {
      throw Error(ErrorCode::input,
                  name +
                      ": no scan in it: no line begins with FLASER, which are what is read of "
                      "logs of CARMEN (ROBOTLASER1 lines are not)");
    }
    return log;
  }

  std::string write(const ScanLog& log) override {
    std::string text = "# CARMEN Logfile\n";
    double range = std::numeric_limits<double>::quiet_NaN();
    for (const LoggedScan& logged : log.scans) {
      check(logged.scan);
      const std::string when = fmt::format("{} cairn {}\n", logged.stamp, logged.stamp);
      const std::string at = pose_text(logged.odometry);
      if (logged.scan.max_range != range) {
        range = logged.scan.max_range;
        text += fmt::format("{}{} {}", kRange, range, when);
      }
      if (logged.truth)
        text += fmt::format("{}{} {} {}", kTruth, pose_text(*logged.truth), at, when);
      text += fmt::format("ODOM {} 0 0 0 {}", at, when);
      text += fmt::format("{}{}", kScan, logged.scan.ranges.size());
      for (const float measured : logged.scan.ranges)
        text += fmt::format(" {}", readable(measured, logged.scan.max_range));
      text += fmt::format(" {} {} {}", at, at, when);
    }
    return text;
  }

 private:
  static std::string pose_text(const Pose2& pose) {
    return fmt::format("{} {} {}", pose.x(), pose.y(), pose.theta());
  }

  /// What `read` takes for the same: it refuses what is not finite.
  static double readable(float measured, double max_range) {
    if (std::isnan(measured)) return kNothing;
    return std::isinf(measured) ? (measured > 0.0F ? max_range : 0.0) : measured;
  }

  static Pose2 pose(Words& words) {
    const double x = words.coordinate("x"), y = words.coordinate("y"),
                 theta = words.coordinate("theta");
    return {x, y, theta};
  }

  static double largest_range(Words words) {
    const double range = words.number("the laser's range");
    if (!(range > 0.0)) words.fail(fmt::format("{:g} is no range of a laser", range));
    return range;
  }

  /// A FLASER line has no angles: its beams are a half circle.
  static void check(const LaserScan& scan) {
    const auto beams = static_cast<double>(scan.ranges.size());
    const double step = std::numbers::pi / (std::fmod(beams, 2.0) == 0.0 ? beams : beams - 1.0);
    constexpr double kSame = 1e-6;  // [rad]
    if (beams < 2.0 || std::abs(scan.first_angle + 0.5 * std::numbers::pi) > kSame ||
        std::abs(scan.angle_step - step) * beams > kSame) {
      throw Error(ErrorCode::usage,
                  fmt::format("a log of CARMEN cannot hold scans of {} beams over {:.4g}°: its "
                              "lidars have an odd number of beams over 180°, as "
                              "fov=180,beams=181",
                              scan.ranges.size(),
                              scan.angle_step * (beams - 1.0) * 180.0 / std::numbers::pi));
    }
    if (!(scan.max_range < kLargest)) {
      throw Error(ErrorCode::usage,
                  fmt::format("a log of CARMEN cannot hold ranges of {:g} m: its lidars see less "
                              "than {:g} m",
                              scan.max_range, kLargest));
    }
  }

  LoggedScan logged(Words words, double max_range) const {
    const double count = words.number("the number of readings");
    if (!(count >= 1.0 && count <= kMostReadings) || count != std::floor(count))
      words.fail(fmt::format("{:g} is no number of readings", count));
    const auto beams = static_cast<std::size_t>(count);
    LoggedScan logged;
    logged.scan = {.first_angle = -0.5 * std::numbers::pi,
                   .angle_step = std::numbers::pi / (beams % 2 == 0 ? count : count - 1.0),
                   .max_range = max_range,
                   .ranges = {}};
    if (beams == 1) logged.scan.angle_step = 0.0;
    logged.scan.ranges.reserve(beams);
    for (std::size_t k = 0; k < beams; ++k) {
      const double range = words.number("a range");
      logged.scan.ranges.push_back(range >= options_.none
                                       ? std::numeric_limits<float>::quiet_NaN()
                                       : static_cast<float>(std::min(range, max_range)));
    }
    logged.odometry = pose(words);
    for (const char* what : {"odom_x", "odom_y", "odom_theta"}) words.number(what);
    logged.stamp = words.number("the time");
    return logged;
  }

  CarmenOptions options_;
};

}  // namespace
}  // namespace cairn::exploration

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::exploration;
  registrar.add<ScanLogFormat, CarmenOptions>(
      "carmen", [](const CarmenOptions& options) { return std::make_unique<Carmen>(options); });
}
