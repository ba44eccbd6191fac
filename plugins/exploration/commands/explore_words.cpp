// SPDX-License-Identifier: BSD-3-Clause
#include "explore_words.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include <fmt/core.h>

#include "cairn/exploration/world.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/program/decimal_number.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

double positive(const char* option, const std::string& key, const std::string& text) {
  const std::optional<double> value = decimal_number(text);
  if (!value || !(*value > 0.0)) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: '{}' is no number above zero for {}", option, text, key));
  }
  return *value;
}

int count(const char* option, const std::string& key, const std::string& text) {
  constexpr double kMost = 1e9;
  const double value = std::min(positive(option, key, text), kMost);
  if (value != std::floor(value)) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: '{}' is no whole number for {}", option, text, key));
  }
  return static_cast<int>(value);
}

OptionValues limit_words(const std::string& words) {
  try {
    return parse_component("until:" + words).values;
  } catch (const Error&) {
    throw Error(ErrorCode::usage,
                fmt::format("--until: '{}' is not of the form distance=250,known=0.99", words));
  }
}

}  // namespace

ExplorationLimits limits_of(const std::string& words) {
  ExplorationLimits limits;
  if (words.empty()) return limits;
  for (const auto& [key, text] : limit_words(words)) {
    if (key == "distance") {
      limits.distance = positive("--until", key, text);
    } else if (key == "steps") {
      limits.steps = count("--until", key, text);
    } else if (key == "decisions") {
      limits.decisions = count("--until", key, text);
    } else if (key == "known") {
      limits.known = positive("--until", key, text);
      if (limits.known > 1.0)
        throw Error(ErrorCode::usage,
                    fmt::format("--until: known is a part of what the body can cover, 0.99 for "
                                "instance, and '{}' is more than all of it",
                                text));
    } else if (key == "rate") {
      limits.rate = positive("--until", key, text);
    } else {
      throw Error(ErrorCode::usage,
                  fmt::format("--until: there is no limit '{}'; there are distance [m], steps, "
                              "decisions, known (part of what the body can cover) and rate (what "
                              "the last {:.0f} m brought [m²/m])",
                              key, ExplorationLimits::kRateDistance));
    }
  }
  return limits;
}

void check_world(std::string_view name, const Registry& registry) {
  constexpr std::array<std::string_view, 3> kMotions{"differential", "holonomic", "dubins"};
  if (std::ranges::find(kMotions, name) == kMotions.end() || registry.has(World::kKind, name))
    return;
  throw Error(ErrorCode::usage, fmt::format("--world: '{0}' is a way to move, no world: --world "
                                            "lidar_building:motion={0}",
                                            name));
}

void check_part_words(const std::string& words, std::string_view option) {
  constexpr std::array kLidar{"fov", "beams", "range", "range_sigma", "dropouts"};
  constexpr std::array kOdometry{"sigma_xy", "sigma_theta", "relative"};
  constexpr std::array kRobot{"radius", "step", "turn", "motion", "turning_radius", "surveyor"};
  if (words.empty()) return;
  const auto holds = [](const auto& all, const std::string& key) {
    return std::ranges::find(all, key) != all.end();
  };
  for (const auto& [key, text] : parse_component("part:" + words).values) {
    std::string_view belongs = option;
    if (holds(kLidar, key)) belongs = "--lidar";
    if (holds(kOdometry, key)) belongs = "--odometry";
    if (holds(kRobot, key)) belongs = "--world";
    if (belongs == option) continue;
    throw Error(
        ErrorCode::usage,
        fmt::format("{0}: '{1}' is an option of the {2}: {3}{1}={4}", option, key,
                    belongs == "--lidar"      ? "lidar"
                    : belongs == "--odometry" ? "odometry"
                                              : "robot",
                    belongs == "--world" ? "--world NAME:" : std::string(belongs) + " ", text));
  }
}

MatchModel match_of(const std::string& words) {
  MatchModel match;
  if (words.empty()) return match;
  for (const auto& [key, text] : parse_component("match:" + words).values) {
    const double value = positive("--match", key, text);
    if (key == "range") {
      match.range = value;
    } else if (key == "angle") {
      match.angle = value;
    } else if (key == "sigma_xy") {
      match.sigma.head<2>().setConstant(value);
    } else if (key == "sigma_theta") {
      match.sigma.z() = value;
    } else {
      throw Error(ErrorCode::usage,
                  fmt::format("--match: there is no '{}'; there are range [m], angle [rad], "
                              "sigma_xy [m] and sigma_theta [rad]",
                              key));
    }
  }
  return match;
}

}  // namespace cairn::app
