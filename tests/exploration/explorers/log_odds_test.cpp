// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "exploration/library/exploration/drawn_map.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

std::unique_ptr<Mapper> mapper(const std::string& options = "limit=4.2") {
  return Registry().make<Mapper>(parse_component("log_odds:" + options));
}

LaserScan random_scan(test::Draw& draw) {
  LaserScan scan{.first_angle = -1.5, .angle_step = 0.1, .max_range = 3.0, .ranges = {}};
  for (int k = 0; k < 31; ++k) {
    const double range = draw.chance(0.1) ? NAN : draw.uniform(0.3, 3.5);
    scan.ranges.push_back(static_cast<float>(std::min(range, 3.0)));
  }
  return scan;
}

Pose2 random_pose(test::Draw& draw) {
  return {draw.uniform(-4.0, 4.0), draw.uniform(-4.0, 4.0), draw.uniform(-3.0, 3.0)};
}

using Cell = std::pair<int, int>;

Cell cell_at(const Vector2d& point, double side) {
  return {static_cast<int>(std::floor(point.x() / side)),
          static_cast<int>(std::floor(point.y() / side))};
}

/// By cell of the world the sum of all scans, by the definition: a beam passes the cells in which
/// it has points, which many points along it find but for corners.
std::map<Cell, double> literal_sum(const std::vector<Pose2>& poses,
                                   const std::vector<LaserScan>& scans, double side) {
  std::map<Cell, double> sum;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    std::set<Cell> hits, passed;
    for (std::size_t beam = 0; beam < scans[k].ranges.size(); ++beam) {
      const double range = scans[k].ranges[beam];
      if (std::isnan(range)) continue;
      const bool hit = range < scans[k].max_range;
      const double length = hit ? range + kSurfaceInset * side : range;
      const double angle = poses[k].theta() + scans[k].angle(beam);
      const Vector2d along(std::cos(angle), std::sin(angle));
      constexpr int kPoints = 20000;
      for (int i = 0; i <= kPoints; ++i)
        passed.insert(cell_at(poses[k].translation() + along * (length * i / kPoints), side));
      if (hit) hits.insert(cell_at(poses[k].translation() + along * length, side));
    }
    for (const Cell& cell : passed) sum[cell] -= hits.contains(cell) ? 0.0 : 0.7;
    for (const Cell& cell : hits) sum[cell] += 1.2;
  }
  return sum;
}

TEST(LogOdds, IsTheSumOfTheEvidenceOfAllScans) {
  test::Draw draw(7);
  const auto map_of = mapper("resolution=0.25,limit=50,smooth=false");
  std::vector<Pose2> poses;
  std::vector<LaserScan> scans;
  for (int k = 0; k < 4; ++k) {
    poses.push_back(random_pose(draw));
    scans.push_back(random_scan(draw));
    map_of->add(poses.back(), scans.back());
  }
  const FloorMap& map = map_of->map();
  const std::map<Cell, double> expected = literal_sum(poses, scans, 0.25);
  int compared = 0;
  for (int y = 0; y < map.frame.height; ++y) {
    for (int x = 0; x < map.frame.width; ++x) {
      const auto found = expected.find(cell_at(map.frame.centre(x, y), 0.25));
      const double value = found == expected.end() ? 0.0 : found->second;
      ASSERT_NEAR(map.log_odds[map.frame.index(x, y)], value, 1e-5) << x << " " << y;
      compared += value != 0.0;
    }
  }
  EXPECT_EQ(static_cast<std::size_t>(compared),
            std::ranges::count_if(expected, [](const auto& cell) { return cell.second != 0.0; }));
}

/// Cells of a wall to the left of a robot that drives along it, of which the map has lost sight:
/// more beams pass the cells of a wall on their way than end in them.
int lost_cells(const std::string& options, double apart) {
  const auto map_of = mapper(options);
  constexpr double kStep = 0.25, kEnd = 12.0, kPi = std::numbers::pi;
  for (double y = 0.0; y <= kEnd; y += kStep) {
    LaserScan scan{
        .first_angle = -0.5 * kPi, .angle_step = kPi / 180, .max_range = 8, .ranges = {}};
    for (std::size_t beam = 0; beam < 181; ++beam) {
      const double aside = std::sin(scan.angle(beam));  // part of the range towards the wall
      const double range = aside > 1e-3 ? apart / aside : scan.max_range;
      scan.ranges.push_back(static_cast<float>(std::min(range, scan.max_range)));
    }
    map_of->add(Pose2(0.0, y, 0.5 * kPi), std::move(scan));
  }
  const FloorMap& map = map_of->map();
  int lost = 0;
  for (double y = 2.05; y < kEnd - 2.0; y += 0.1) {
    const Vector2d inside(-apart - kSurfaceInset * 0.1, y);
    const Cell cell = cell_at(map.frame.to_cells(inside), 1.0);
    lost += map.cells[map.frame.index(cell.first, cell.second)] == CellState::free;
  }
  return lost;
}

TEST(LogOdds, AWallAlongWhichTheRobotDrivesStays) {
  int lost = 0, lost_with_less = 0, lost_with_more = 0;
  for (double apart = 0.5; apart < 1.5; apart += 0.03) {
    lost += lost_cells("limit=4.2", apart);
    lost_with_less += lost_cells("hit=0.9", apart);
    lost_with_more += lost_cells("hit=1.4", apart);
  }
  EXPECT_LE(lost, 6);  // of 2,700
  EXPECT_GT(lost_with_less, 40);
  EXPECT_EQ(lost_with_more, 0);
}

/// What has moved is as if it had been there from the beginning, to the last bit.
TEST(LogOdds, AMapWhosePosesMoveIsTheOneOfTheNewPoses) {
  test::Draw draw(11);
  for (const int moving : {1, 3, 10}) {  // few: taken out and put in; most: all anew
    const auto moved = mapper("tolerance=0"), fresh = mapper();
    std::vector<Pose2> poses;
    std::vector<LaserScan> scans;
    for (int k = 0; k < 10; ++k) {
      poses.push_back(random_pose(draw));
      scans.push_back(random_scan(draw));
      moved->add(poses.back(), scans.back());
    }
    moved->map();
    EXPECT_FALSE(moved->move(poses));
    for (int k = 0; k < moving; ++k) poses[static_cast<std::size_t>(k)] = random_pose(draw);
    EXPECT_TRUE(moved->move(poses));
    for (std::size_t k = 0; k < poses.size(); ++k) fresh->add(poses[k], scans[k]);
    const FloorMap &a = moved->map(), &b = fresh->map();
    for (int y = 0; y < b.frame.height; ++y) {
      for (int x = 0; x < b.frame.width; ++x) {
        const Vector2d there = a.frame.to_cells(b.frame.centre(x, y)).array().floor();
        const int u = static_cast<int>(there.x()), v = static_cast<int>(there.y());
        const float value = a.frame.contains(u, v) ? a.log_odds[a.frame.index(u, v)] : 0.0F;
        ASSERT_EQ(value, b.log_odds[b.frame.index(x, y)]);
      }
    }
    EXPECT_DOUBLE_EQ(a.coverage(), b.coverage());
    EXPECT_EQ(a.frontiers.size(), b.frontiers.size());
  }
}

TEST(LogOdds, SmallMotionsLeaveTheMap) {
  test::Draw draw(2);
  const auto map_of = mapper("resolution=0.1,tolerance=0.25");
  map_of->add(Pose2(), random_scan(draw));
  EXPECT_FALSE(map_of->move(std::vector{Pose2(0.02, 0.0, 0.0)}));
  EXPECT_TRUE(map_of->move(std::vector{Pose2(0.03, 0.0, 0.0)}));
  EXPECT_TRUE(map_of->move(std::vector{Pose2(0.03, 0.0, 0.03)}));  // turned: 0.03 × the mean range
}

/// Frontiers and clearance against their definitions.
TEST(LogOdds, FrontiersAreFreeCellsBesideUnknownOnes) {
  test::Draw draw(13);
  const auto map_of = mapper("resolution=0.2");
  for (int k = 0; k < 6; ++k) map_of->add(random_pose(draw), random_scan(draw));
  const FloorMap& map = map_of->map();
  const GridFrame& frame = map.frame;
  const auto unknown = [&](int x, int y) {
    return !frame.contains(x, y) || map.cells[frame.index(x, y)] == CellState::unknown;
  };
  std::set<std::int32_t> expected;
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const bool free = map.cells[frame.index(x, y)] == CellState::free;
      if (free &&
          (unknown(x - 1, y) || unknown(x + 1, y) || unknown(x, y - 1) || unknown(x, y + 1)))
        expected.insert(static_cast<std::int32_t>(frame.index(x, y)));
    }
  }
  std::set<std::int32_t> found;
  double longest = std::numeric_limits<double>::infinity();
  for (const Frontier& frontier : map.frontiers) {
    EXPECT_LE(frontier.length, longest);
    longest = frontier.length;
    EXPECT_NEAR(frontier.length, 0.2 * static_cast<double>(frontier.cells.size()), 1e-9);
    for (const std::int32_t cell : frontier.cells) EXPECT_TRUE(found.insert(cell).second);
  }
  EXPECT_EQ(found, expected);
  ASSERT_FALSE(expected.empty());
  // Where nothing of the newest scan ends, clearance is to what is not free; it is never more.
  const std::vector<float> literal = test::literal_clearance(frame, map.cells);
  for (std::size_t k = 0; k < literal.size(); ++k) EXPECT_LE(map.clearance[k], literal[k] + 1e-4F);
}

/// One beam of the newest scan ends where nine scans have seen nothing.
TEST(LogOdds, TheNewestScanStandsInTheWayOfABodyThatIsNear) {
  struct Case {
    const char* options;
    double range;
    bool in_the_way;
  };
  for (const Case& c : {Case{"resolution=0.1", 1.35, true}, Case{"resolution=0.1", 1.95, false},
                        Case{"resolution=0.1,newest=2.5", 1.95, true},
                        Case{"resolution=0.1,newest=0", 1.35, false}}) {
    SCOPED_TRACE(std::string(c.options) + " " + std::to_string(c.range));
    const auto map_of = mapper(c.options);
    LaserScan open{.first_angle = -0.6, .angle_step = 0.01, .max_range = 4.0, .ranges = {}};
    open.ranges.assign(121, 3.0F);
    for (int k = 0; k < 9; ++k) map_of->add(Pose2(0.05, 0.05, 0.0), open);
    const auto there = [&](const FloorMap& map) {
      const Vector2d cell = map.frame.to_cells({c.range + 0.1, 0.05}).array().floor();
      return map.frame.index(static_cast<int>(cell.x()), static_cast<int>(cell.y()));
    };
    const float before = map_of->map().clearance[there(map_of->map())];
    EXPECT_GT(before, 0.5F);
    LaserScan blocked = open;
    blocked.ranges[60] = static_cast<float>(c.range);  // straight ahead
    map_of->add(Pose2(0.05, 0.05, 0.0), blocked);
    const FloorMap& map = map_of->map();
    EXPECT_EQ(map.cells[there(map)], CellState::free);  // by the majority of scans
    EXPECT_EQ(map.clearance[there(map)], c.in_the_way ? 0.0F : before);
  }
}

/// A wall that fills a cell in part: one scan of five ends there.
TEST(LogOdds, CautionIsTheDistanceToCellsInWhichSomeBeamsEnd) {
  for (const bool counts : {true, false}) {
    const auto map_of =
        mapper(counts ? "resolution=0.1,part_filled=0.2" : "resolution=0.1,part_filled=0.21");
    LaserScan open{.first_angle = -0.6, .angle_step = 0.01, .max_range = 4.0, .ranges = {}};
    open.ranges.assign(121, 3.0F);
    LaserScan ends = open;
    ends.ranges[60] = 1.95F;  // straight ahead
    map_of->add(Pose2(0.05, 0.05, 0.0), ends);
    for (int k = 0; k < 4; ++k) map_of->add(Pose2(0.05, 0.05, 0.0), open);
    const FloorMap& map = map_of->map();
    const auto at = [&](double x) {
      const Vector2d cell = map.frame.to_cells({x, 0.05}).array().floor();
      return map.frame.index(static_cast<int>(cell.x()), static_cast<int>(cell.y()));
    };
    EXPECT_EQ(map.cells[at(2.05)], CellState::free);
    EXPECT_GT(map.clearance[at(2.05)], 0.5F);
    if (counts) {
      EXPECT_EQ(map.caution[at(2.05)], 0.0F);
      EXPECT_NEAR(map.caution[at(1.75)], 0.3, 1e-6);
      EXPECT_NEAR(map.caution[at(2.25)], 0.2, 1e-6);
    } else {
      EXPECT_EQ(map.caution, map.clearance);
    }
    // Where a beam ends in more scans than not, the cell is no free one, and limits both.
    for (std::size_t k = 0; k < map.cells.size(); ++k) EXPECT_LE(map.caution[k], map.clearance[k]);
  }
}

TEST(LogOdds, WhatIsNoScanAndWhatIsTooFarAwayIsRefusedAndLeavesTheMap) {
  test::Draw draw(19);
  const auto map_of = mapper("resolution=0.1");
  map_of->add(Pose2(), random_scan(draw));
  const auto refusal = [&](const Pose2& at, const LaserScan& scan) -> std::string {
    try {
      map_of->add(at, scan);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::input);
      return error.what();
    }
    return "taken";
  };
  const std::vector<float> before = map_of->map().log_odds;
  LaserScan empty = random_scan(draw), turning = empty, endless = empty;
  empty.ranges.clear();
  turning.angle_step = NAN;
  endless.max_range = INFINITY;
  EXPECT_THAT(refusal(Pose2(), empty), testing::HasSubstr("scan 1: a scan without beams"));
  EXPECT_THAT(refusal(Pose2(), turning), testing::HasSubstr("finite angles"));
  EXPECT_THAT(refusal(Pose2(), endless), testing::HasSubstr("largest range of inf m"));
  EXPECT_THAT(refusal(Pose2(9000.0, 9000.0, 0.0), random_scan(draw)),
              testing::HasSubstr("a scan at (9000, 9000): with it the map has"));
  EXPECT_THAT(refusal(Pose2(1e200, 0.0, 0.0), random_scan(draw)), testing::HasSubstr("1e+200"));
  EXPECT_THAT(refusal(Pose2(0.0, NAN, 0.0), random_scan(draw)), testing::HasSubstr("not finite"));
  EXPECT_THAT(refusal(Pose2(0.0, 0.0, NAN), random_scan(draw)), testing::HasSubstr("not finite"));
  // Scans without a measurement show nothing.
  LaserScan blind = random_scan(draw);
  for (std::size_t k = 0; k < blind.ranges.size(); ++k)
    blind.ranges[k] = std::array{NAN, 0.0F, -1.0F, -INFINITY}[k % 4];
  EXPECT_EQ(refusal(Pose2(1.0, 0.0, 0.0), blind), "taken");
  EXPECT_EQ(map_of->map().log_odds, before);
}

TEST(LogOdds, GrowsWithWhatItSeesAndRefusesWhatIsNowhere) {
  test::Draw draw(17);
  const auto map_of = mapper();
  EXPECT_EQ(map_of->map().cells.size(), 0U);
  map_of->add(Pose2(), random_scan(draw));
  const double before = map_of->map().coverage();
  map_of->add(Pose2(30.0, -20.0, 1.0), random_scan(draw));
  EXPECT_GT(map_of->map().coverage(), before);
  EXPECT_THROW(map_of->add(Pose2(NAN, 0.0, 0.0), random_scan(draw)), Error);
  EXPECT_THROW(map_of->add(Pose2(1e9, 0.0, 0.0), random_scan(draw)), Error);
  map_of->reset();
  EXPECT_EQ(map_of->map().cells.size(), 0U);
}

}  // namespace
}  // namespace cairn
