// SPDX-License-Identifier: BSD-3-Clause
// Logs of scans: the first byte chooses the options, the rest is the log. It is refused where a
// second reading of the format, written for this, refuses it, and else has the same scans. A map is
// made of them, or they are refused.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/scan_log.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr double kNoMeasurement = std::numeric_limits<double>::quiet_NaN();

struct Reader {
  double range, none;
  std::unique_ptr<ScanLogFormat> format;
};

const Reader& reader(std::size_t index) {
  static const auto all = [] {
    std::array<Reader, 3> made{{{20.0, 80.0, {}}, {0.5, 1000.0, {}}, {100.0, 8.0, {}}}};
    for (Reader& one : made) {
      one.format = registry().make<ScanLogFormat>(
          parse_component(fmt::format("carmen:range={},none={}", one.range, one.none)));
    }
    return made;
  }();
  return all[index % all.size()];
}

/// The next word as a finite number, decimal as of strtod, without a plus sign.
std::optional<double> number(std::istream& words) {
  std::string word;
  if (!(words >> word)) return std::nullopt;
  if (word.find_first_not_of("0123456789+-.eE") != word.npos || word.front() == '+')
    return std::nullopt;
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  // std::from_chars refuses what is too small for a double as well.
  if (*end != '\0' || !std::isfinite(value)) return std::nullopt;
  if (value == 0.0 &&
      word.substr(0, word.find_first_of("eE")).find_first_of("123456789") != word.npos)
    return std::nullopt;
  return value;
}

/// The numbers of a FLASER line up to its first time stamp; none: it is malformed.
std::optional<std::vector<double>> numbers(const std::string& line) {
  std::string text = line;
  // Only blanks, tabs and carriage returns are between words.
  for (char& c : text) {
    if (c == '\v' || c == '\f' || c == '\0') c = '?';
  }
  std::istringstream words(text);
  std::vector<double> all;
  const std::optional<double> count = number(words);
  if (!count || *count < 1.0 || *count > 100000.0 || *count != std::floor(*count))
    return std::nullopt;
  for (int k = 0; k < static_cast<int>(*count) + 7; ++k) {
    const std::optional<double> value = number(words);
    if (!value) return std::nullopt;
    all.push_back(*value);
  }
  // Poses of another world are malformed.
  const std::size_t beams = all.size() - 7;
  for (std::size_t k = beams; k < beams + 3; ++k) {
    if (std::abs(all[k]) > 1e9) return std::nullopt;
  }
  return all;
}

/// A line that means something, without its tag.
struct Line {
  enum class Kind { scan, truth, range } kind;
  std::string text;
};

std::vector<Line> tagged_lines(std::string_view text) {
  static const std::array<std::pair<std::string, Line::Kind>, 3> tags{
      {{"FLASER ", Line::Kind::scan},
       {"TRUEPOS ", Line::Kind::truth},
       {"PARAM robot_front_laser_max ", Line::Kind::range}}};
  std::vector<Line> lines;
  std::istringstream in{std::string(text)};
  for (std::string line; std::getline(in, line);) {
    for (const auto& [tag, kind] : tags) {
      if (line.starts_with(tag)) lines.push_back({kind, line.substr(tag.size())});
    }
  }
  return lines;
}

/// The first `count` words as numbers.
std::optional<std::vector<double>> leading_numbers(std::string text, int count) {
  for (char& c : text) {
    if (c == '\v' || c == '\f' || c == '\0') c = '?';
  }
  std::istringstream words(text);
  std::vector<double> all;
  for (int k = 0; k < count; ++k) {
    const std::optional<double> value = number(words);
    if (!value) return std::nullopt;
    all.push_back(*value);
  }
  return all;
}

struct ExpectedScan {
  std::vector<double> numbers;
  double range;
  std::optional<std::vector<double>> truth;
};

/// False: the line is malformed.
bool take(const Line& line, const Reader& from, std::vector<ExpectedScan>& scans, double& range,
          std::optional<std::vector<double>>& truth) {
  if (line.kind == Line::Kind::scan) {
    const auto all = numbers(line.text);
    if (!all) return false;
    scans.push_back({*all, range, std::exchange(truth, std::nullopt)});
    return true;
  }
  const auto values = leading_numbers(line.text, line.kind == Line::Kind::truth ? 3 : 1);
  if (!values) return false;
  if (line.kind == Line::Kind::truth) {
    truth = values;
    return std::ranges::all_of(*values, [](double value) { return std::abs(value) <= 1e9; });
  }
  range = std::min(from.range, values->front());
  return values->front() > 0.0;
}

bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

void expect_scan(const LoggedScan& scan, const ExpectedScan& all, const Reader& reader) {
  const std::vector<double>& expected = all.numbers;
  const std::size_t beams = expected.size() - 7;
  expect(scan.truth.has_value() == all.truth.has_value() &&
             (!scan.truth ||
              (scan.truth->x() == all.truth->at(0) && scan.truth->y() == all.truth->at(1))),
         [] { return "another truth"; });
  expect(scan.scan.ranges.size() == beams && scan.scan.max_range == all.range &&
             std::isfinite(scan.scan.angle(beams - 1)),
         [&] { return fmt::format("a scan with {} beams", scan.scan.ranges.size()); });
  for (std::size_t k = 0; k < beams; ++k) {
    const double range =
        expected[k] >= reader.none ? kNoMeasurement : std::min(expected[k], all.range);
    expect(same(scan.scan.ranges[k], static_cast<float>(range)),
           [&] { return fmt::format("a range of {}, not {}", scan.scan.ranges[k], range); });
  }
  const double* const pose = &expected[beams];
  const double turned = std::abs(std::remainder(scan.odometry.theta() - pose[2], 2.0 * M_PI));
  expect(scan.odometry.x() == pose[0] && scan.odometry.y() == pose[1] && scan.stamp == pose[6] &&
             std::abs(scan.odometry.theta()) < 3.2 && (turned < 1e-9 || std::abs(pose[2]) > 1e3),
         [&] { return fmt::format("a pose turned by {} instead of {}", turned, pose[2]); });
}

/// Either a map of finite numbers, or poses are too far away for one. Of logs that stay near.
void expect_map(const ScanLog& log) {
  static const std::unique_ptr<Mapper> mapper =
      registry().has(Mapper::kKind, "log_odds")
          ? registry().make<Mapper>(parse_component("log_odds:resolution=1"))
          : nullptr;
  constexpr double kFar = 200.0;
  constexpr std::size_t kMostScans = 20;
  if (!mapper) return;
  mapper->reset();
  std::vector<Pose2> poses;
  for (const LoggedScan& scan : log.scans) {
    const bool near = scan.odometry.translation().cwiseAbs().maxCoeff() < kFar;
    const bool beyond = !(scan.odometry.translation().cwiseAbs().maxCoeff() < 1e7);
    if (poses.size() == kMostScans || (!near && !beyond)) break;
    try {
      mapper->add(scan.odometry, scan.scan);
      expect(near, [] { return "a scan at the end of the world was taken"; });
      poses.push_back(scan.odometry);
    } catch (const Error& error) {
      expect(error.code() == ErrorCode::input && beyond,
             [&] { return fmt::format("a scan was refused: {}", error.what()); });
    }
  }
  const FloorMap map = mapper->map();
  for (Pose2& pose : poses) pose = pose * Pose2(1.5, 0.0, 0.2);
  mapper->move(poses);
  for (const FloorMap* each : std::array<const FloorMap*, 2>{&map, &mapper->map()}) {
    expect(std::ssize(each->cells) == each->frame.size() &&
               each->clearance.size() == each->cells.size() &&
               each->log_odds.size() == each->cells.size() && std::isfinite(each->entropy()),
           [] { return "a map that does not fit together"; });
  }
}

void run(Bytes bytes) {
  Source source(bytes);
  const Reader& from = reader(source.byte());
  const std::string_view text = text_of(source.rest());
  const std::vector<Line> lines = tagged_lines(text);
  std::vector<ExpectedScan> expected;
  std::size_t good = 0;
  double range = from.range;
  std::optional<std::vector<double>> truth;
  while (good < lines.size() && take(lines[good], from, expected, range, truth)) ++good;
  const bool sound = good == lines.size() && !expected.empty();
  ScanLog log;
  try {
    log = from.format->read(text, "input");
    expect(sound, [&] { return "taken, but malformed: " + lines.at(good).text; });
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::input && std::string_view(error.what()).starts_with("input:"),
           [&] { return fmt::format("refused by: {}", error.what()); });
    expect(!sound, [&] { return fmt::format("refused, but sound: {}", error.what()); });
    return;
  }
  expect(log.scans.size() == expected.size(), [] { return "scans are missing"; });
  for (std::size_t k = 0; k < expected.size(); ++k) expect_scan(log.scans[k], expected[k], from);
  expect_map(log);
}

std::vector<std::string> seeds() {
  const std::string head = "# CARMEN Logfile\nPARAM robot_length 0.47 0.1 host 0.1\n",
                    odometry = "ODOM 0.1 0.2 0.3 0 0 0 0.5 host 0.1\n",
                    one = "FLASER 5 1.5 2.25 81.91 3 0.02 1 2 0.5 1 2 0.5 10.25 host 0.2\n",
                    two = "FLASER 4 1 2 -3 79.9 -1 -2 -0.5 0 0 0 11 host 0.3\n";
  const std::string truth = "TRUEPOS 4 5 0.25 1 2 0.5 1 host 1\n",
                    range = "PARAM robot_front_laser_max 8 0 cairn 0\n";
  std::string wide = "FLASER 181";
  for (int k = 0; k < 181; ++k) wide += fmt::format(" {:.2f}", 2.0 + 0.01 * (k % 30));
  wide += " 0 0 0 0 0 0 1 host 1\n";
  return {'\0' + head + odometry + one + odometry + two,
          '\0' + range + truth + one + two + range,
          '\1' + truth + truth + one + truth,
          '\1' + one + two,
          '\2' + one + two + one,
          '\0' + wide,
          '\0' + wide + one,
          std::string(1, '\0') + "FLASER 1 5 1e300 -1e300 1e300 0 0 0 1 h 1",
          std::string(1, '\0') + "FLASER 3 1 2 3 0 0\n" + one,
          std::string(1, '\0') + "FLASER 2 1 nan 0 0 0 0 0 0 1 h 1\n",
          '\0' + odometry,
          '\0' + one.substr(0, one.size() - 1) + "\r\n" + two,
          '\0' + head + "FLASER\n" + one};
}

std::vector<std::string> words() {
  return {"FLASER ",
          "\nFLASER 1 ",
          "FLASER 2 ",
          "ODOM ",
          "PARAM ",
          "ROBOTLASER1 ",
          "TRUEPOS ",
          "\nPARAM robot_front_laser_max ",
          " 0 0 0 0 0 0 0 h 0\n",
          "\r\n",
          "\t",
          "#",
          "nan",
          "-inf",
          "1e308",
          "1e-320",
          "-0",
          "+1",
          "0x10",
          "81.91",
          "100000",
          "100001",
          "1e9",
          "3.14159265358979"};
}

}  // namespace

Target scan_log() {
  return {"scan_log", &run, &seeds, &words, {{ScanLogFormat::kKind, "carmen"}}, 1024};
}

}  // namespace cairn::fuzz
