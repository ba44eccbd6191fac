// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/laser_scan.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

LaserScan good() {
  return {.first_angle = -1.0, .angle_step = 0.5, .max_range = 8.0, .ranges = {1.0F, 2.0F, 9.0F}};
}

std::string refusal(const LaserScan& scan) {
  try {
    check_scan(scan, "scan 7");
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    return error.what();
  }
  return "";
}

TEST(CheckScan, WhatIsNoScanIsRefused) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal(good()), "");
  const std::vector<std::function<void(LaserScan&)>> faults = {
      [](LaserScan& s) { s.ranges.clear(); },     [&](LaserScan& s) { s.first_angle = nan; },
      [&](LaserScan& s) { s.first_angle = inf; }, [&](LaserScan& s) { s.angle_step = nan; },
      [](LaserScan& s) { s.angle_step = 4.0; },   [](LaserScan& s) { s.angle_step = -4.0; },
      [](LaserScan& s) { s.max_range = 0.0; },    [&](LaserScan& s) { s.max_range = nan; },
      [&](LaserScan& s) { s.max_range = inf; }};
  for (std::size_t k = 0; k < faults.size(); ++k) {
    LaserScan scan = good();
    faults[k](scan);
    EXPECT_TRUE(refusal(scan).starts_with("scan 7: a scan ")) << k;
  }
  // A full circle, and one that ends where it began.
  LaserScan circle = good();
  circle.angle_step = std::numbers::pi;
  EXPECT_EQ(refusal(circle), "");
}

TEST(CheckScan, AnyRangeIsGoodAndNotEachIsAMeasurement) {
  LaserScan scan = good();
  const float inf = std::numeric_limits<float>::infinity();
  scan.ranges = {NAN, 0.0F, -1.0F, -inf, inf, 8.0F, 0.5F};
  EXPECT_EQ(refusal(scan), "");
  EXPECT_EQ(measured_beams(scan), 3U);
}

}  // namespace
}  // namespace cairn
