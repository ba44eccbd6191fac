// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/time_stamps.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>

namespace cairn {
namespace {

constexpr std::array<StampUnit, 3> kUnits{
    {{"milliseconds", -3}, {"microseconds", -6}, {"nanoseconds", -9}}};
constexpr double kEarliest = 1.0e9, kLatest = 2.25e9;  // September 2001 and April 2041 [s]

}  // namespace

StampUnit stamp_unit(std::span<const double> stamps) {
  for (const StampUnit& unit : kUnits) {
    const double scale = std::pow(10.0, unit.exponent);
    const auto is_recent = [scale](double stamp) {
      return stamp * scale >= kEarliest && stamp * scale < kLatest;
    };
    if (!stamps.empty() && std::ranges::all_of(stamps, is_recent)) return unit;
  }
  return {};
}

double seconds_of(std::string_view text, const StampUnit& unit) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const std::size_t e = text.find_first_of("eE");
  std::int64_t exponent = 0;
  if (e != std::string_view::npos) {
    std::string_view digits = text.substr(e + 1);
    if (digits.starts_with('+')) digits.remove_prefix(1);
    std::from_chars(digits.data(), digits.data() + digits.size(), exponent);
  }
  const std::string shifted =
      std::string(text.substr(0, e)) + "e" + std::to_string(exponent + unit.exponent);
  double seconds = 0.0;
  std::from_chars(shifted.data(), shifted.data() + shifted.size(), seconds);
  return seconds;
}

}  // namespace cairn
