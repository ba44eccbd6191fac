// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/grid.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

TEST(GridFrame, ATurnedGridIsWhereItsCornerAndItsAnglePutIt) {
  // By a quarter to the left: columns run along y, rows against x.
  const GridFrame frame{.width = 4,
                        .height = 3,
                        .resolution = 0.5,
                        .origin = {10.0, 20.0},
                        .yaw = std::numbers::pi / 2};
  EXPECT_TRUE(frame.centre(0, 0).isApprox(Vector2d(9.75, 20.25)));
  EXPECT_TRUE(frame.centre(3, 0).isApprox(Vector2d(9.75, 21.75)));
  EXPECT_TRUE(frame.centre(0, 2).isApprox(Vector2d(8.75, 20.25)));
  for (const Vector2d& point : {Vector2d(0.0, 0.0), Vector2d(-3.25, 17.5)})
    EXPECT_TRUE(frame.to_world(frame.to_cells(point)).isApprox(point, 1e-14)) << point;
  EXPECT_EQ(frame.index(3, 2), 11U);
  EXPECT_EQ(frame.size(), 12);
  EXPECT_TRUE(frame.contains(3, 2));
  EXPECT_FALSE(frame.contains(4, 2));
  EXPECT_FALSE(frame.contains(0, -1));
}

TEST(CellThresholds, TheirOwnValuesAreFreeAndOccupied) {
  const CellThresholds thresholds{.free = 25, .occupied = 65};
  EXPECT_EQ(thresholds.state(0), CellState::free);
  EXPECT_EQ(thresholds.state(25), CellState::free);
  EXPECT_EQ(thresholds.state(26), CellState::unknown);
  EXPECT_EQ(thresholds.state(64), CellState::unknown);
  EXPECT_EQ(thresholds.state(65), CellState::occupied);
  EXPECT_EQ(thresholds.state(100), CellState::occupied);
  EXPECT_EQ(thresholds.state(kUnknownCell), CellState::unknown);
}

TEST(GridFrame, WhatIsNoGridIsRefused) {
  const GridFrame good{.width = 2, .height = 2, .resolution = 0.1};
  EXPECT_NO_THROW(check_frame(good, "floor"));
  const auto refused = [](const GridFrame& frame) {
    try {
      check_frame(frame, "floor");
    } catch (const Error& error) {
      return error.code() == ErrorCode::input && std::string(error.what()).starts_with("floor: ");
    }
    return false;
  };
  const double inf = std::numeric_limits<double>::infinity();
  const std::vector<std::function<void(GridFrame&)>> faults = {
      [](GridFrame& f) { f.width = 0; },
      [](GridFrame& f) { f.height = -1; },
      [](GridFrame& f) { f.width = f.height = 20000; },
      [](GridFrame& f) { f.resolution = 0.0; },
      [&](GridFrame& f) { f.resolution = inf; },
      [](GridFrame& f) { f.resolution = 1e-7; },
      [](GridFrame& f) { f.origin.y() = 1e10; },
      [](GridFrame& f) { f.origin.y() = std::nan(""); },
      [](GridFrame& f) { f.origin.x() = std::nan(""); },
      [&](GridFrame& f) { f.yaw = inf; }};
  for (std::size_t k = 0; k < faults.size(); ++k) {
    GridFrame bad = good;
    faults[k](bad);
    EXPECT_TRUE(refused(bad)) << "fault " << k;
  }
}

}  // namespace
}  // namespace cairn
