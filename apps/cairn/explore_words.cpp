// SPDX-License-Identifier: BSD-3-Clause
#include "explore_words.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <exception>

#include <fmt/core.h>

#include "cairn/plugin/options.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

double positive(const char* option, const std::string& key, const std::string& text) {
  std::size_t read = 0;
  double value = 0.0;
  try {
    value = std::stod(text, &read);
  } catch (const std::exception&) {
    read = 0;
  }
  if (read == 0 || read != text.size() || !(value > 0.0)) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: '{}' is no number above zero for {}", option, text, key));
  }
  return value;
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
    throw Error(
        ErrorCode::usage,
        fmt::format("--until: '{}' is not of the form distance=250,steps=N,decisions=N", words));
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
    } else {
      throw Error(ErrorCode::usage,
                  fmt::format("--until: there is no limit '{}'; there are distance [m], steps and "
                              "decisions",
                              key));
    }
  }
  return limits;
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
