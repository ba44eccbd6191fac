// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/known_surroundings.hpp"

#include <cstddef>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "exploration/library/exploration/drawn_map.hpp"

namespace cairn {
namespace {

/// Of 4 m × 4 m with cells of 0.1 m, unknown.
std::vector<std::string> unknown_rows() {
  return std::vector<std::string>(40, std::string(40, ' '));
}

FloorMap map_of(const std::vector<std::string>& rows) { return test::drawn_map(rows, 0.1); }

TEST(KnownSurroundings, CountsCellsWithinAMetre) {
  std::vector<std::string> rows = unknown_rows();
  const KnownSurroundings then(map_of(rows), {2.05, 2.05});
  EXPECT_TRUE(then.same_as(map_of(rows)));
  rows[20][31] = rows[31][20] = rows[5][5] = '.';
  EXPECT_TRUE(then.same_as(map_of(rows))) << "too far away";
  rows[20][30] = '#';
  EXPECT_FALSE(then.same_as(map_of(rows)));
  EXPECT_FALSE(then.more_in(map_of(rows))) << "a single cell";
}

TEST(KnownSurroundings, ATwentiethOfTheCellsIsMore) {
  std::vector<std::string> rows = unknown_rows();
  const KnownSurroundings then(map_of(rows), {2.05, 2.05});
  // 21 × 21 cells lie within 1 m, of which 22 are a twentieth.
  rows[20].replace(15, 11, 11, '.');
  rows[21].replace(15, 11, 11, '#');
  EXPECT_FALSE(then.more_in(map_of(rows)));
  rows[22][20] = '.';
  EXPECT_TRUE(then.more_in(map_of(rows)));
}

TEST(KnownSurroundings, WhatLiesOutsideTheMapIsUnknown) {
  std::vector<std::string> rows = unknown_rows();
  const KnownSurroundings then(map_of(rows), {-5.0, 0.0});
  for (std::string& row : rows) row.assign(40, '.');
  EXPECT_TRUE(then.same_as(map_of(rows)));
}

}  // namespace
}  // namespace cairn
