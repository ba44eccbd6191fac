// SPDX-License-Identifier: BSD-3-Clause
// Logs of CARMEN (the Carnegie Mellon robot navigation toolkit): a message per line, of which
//
//     FLASER n r_1 … r_n x y theta odom_x odom_y odom_theta stamp host stamp
//
// is a scan of the front laser. x, y, theta is where odometry has the laser.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>

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
    for (std::size_t number = 1; !text.empty(); ++number) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      constexpr std::string_view kTag = "FLASER ";
      if (const std::string_view line = text.substr(0, end); line.starts_with(kTag)) {
        Words words(line.substr(kTag.size()), fmt::format("{}:{}", name, number));
        if (auto scan = logged(words)) log.scans.push_back(std::move(*scan));
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

 private:
  std::optional<LoggedScan> logged(Words& words) const {
    const double count = words.number("the number of readings");
    if (!(count >= 1.0 && count <= kMostReadings) || count != std::floor(count))
      words.fail(fmt::format("{:g} is no number of readings", count));
    const auto beams = static_cast<std::size_t>(count);
    LoggedScan logged;
    logged.scan = {.first_angle = -0.5 * std::numbers::pi,
                   .angle_step = std::numbers::pi / (beams % 2 == 0 ? count : count - 1.0),
                   .max_range = options_.range,
                   .ranges = {}};
    if (beams == 1) logged.scan.angle_step = 0.0;
    logged.scan.ranges.reserve(beams);
    for (std::size_t k = 0; k < beams; ++k) {
      const double range = words.number("a range");
      logged.scan.ranges.push_back(range >= options_.none
                                       ? std::numeric_limits<float>::quiet_NaN()
                                       : static_cast<float>(std::min(range, options_.range)));
    }
    const double x = words.coordinate("x"), y = words.coordinate("y"),
                 theta = words.coordinate("theta");
    logged.odometry = Pose2(x, y, theta);
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
