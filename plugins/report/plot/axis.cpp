// SPDX-License-Identifier: BSD-3-Clause
#include "axis.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/core.h>

namespace cairn::plot {
namespace {

/// The smallest of 1, 2, 5 times a power of ten that is not below `step`.
double round_up(double step) {
  const double power = std::pow(10.0, std::floor(std::log10(step)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= step * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

}  // namespace

double Range::part(double value) const {
  if (!logarithmic) return (value - low) / (high - low);
  return std::log(value / low) / std::log(high / low);
}

std::vector<double> Range::ticks(int count) const {
  std::vector<double> all;
  const double decades = logarithmic ? std::log10(high / low) : 0;
  if (logarithmic && decades >= 1) {
    const double step = std::max(1.0, std::ceil(decades / count));
    // 2 and 5 times the power below `low` may be in the range.
    const double first = step > 1 ? std::ceil(std::log10(low) - 1e-9) : std::floor(std::log10(low));
    for (double e = first; e <= std::log10(high) + 1e-9; e += step) {
      for (const double factor : {1.0, 2.0, 5.0}) {
        const double tick = factor * std::pow(10.0, e);
        // Within few decades one tick in each would be too few.
        const bool wanted = factor == 1 || decades < 2.5;
        if (wanted && tick >= low * (1 - 1e-9) && tick <= high * (1 + 1e-9)) all.push_back(tick);
      }
    }
    if (all.size() >= 2) return all;
    all.clear();
  }
  double step = round_up((high - low) / std::max(count, 1));
  if (whole) step = std::max(step, 1.0);
  for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) {
    all.push_back(k == 0 ? 0 : k * step);
    if (all.size() > 100) break;  // a range that a double cannot divide
  }
  return all;
}

Range range_of(const std::vector<double>& values, bool logarithmic) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : values) {
    if (!std::isfinite(value) || (logarithmic && value <= 0)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (low > high) return {logarithmic ? 1.0 : 0.0, logarithmic ? 10.0 : 1.0, logarithmic};
  if (logarithmic) {
    const double room = std::max(std::pow(high / low, 0.04), 1.05);
    return {low / room, high * room, true};
  }
  const double room = high > low ? 0.03 * (high - low) : std::max(std::abs(high) * 0.1, 0.5);
  return {low - room, high + room, false};
}

std::string tick_text(double value) {
  const double size = std::abs(value);
  if (size != 0 && (size >= 1e6 || size < 1e-3)) {
    const int exponent = static_cast<int>(std::floor(std::log10(size) + 1e-9));
    return fmt::format("{:g}e{}", value / std::pow(10.0, exponent), exponent);
  }
  return fmt::format("{:.6g}", value);
}

}  // namespace cairn::plot
