// SPDX-License-Identifier: BSD-3-Clause
// Rays over a real floor, and maps of it: that they are right, and how long they take (printed, not
// tested). CAIRN_RAYS: so many rays; CAIRN_SCANS: so many scans.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/plugin/registry.hpp"
#include "support/components.hpp"
#include "support/data.hpp"
#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

constexpr double kRange = 8.0;
constexpr std::size_t kBeams = 181;

int asked(const char* variable, int otherwise) {
  const char* const text = std::getenv(variable);
  return text ? std::atoi(text) : otherwise;
}

/// Of processor time.
double milliseconds_since(std::clock_t begin) {
  return 1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
}

class FloorStudy : public testing::Test {
 protected:
  void SetUp() override {
    CAIRN_NEEDS_DATA();
    CAIRN_NEEDS("grid_format", "ros");
    CAIRN_NEEDS("mapper", "log_odds");
    floor_ = read_grid((test::data_folder() / "maps" / "fr079.yaml").string(), registry_);
    rays_.emplace(floor_);
    for (std::size_t k = 0; k < floor_.occupancy.size(); ++k) {
      if (CellThresholds{}.state(floor_.occupancy[k]) == CellState::free) free_.push_back(k);
    }
  }
  Pose2 free_pose() {
    const std::size_t k = free_[static_cast<std::size_t>(draw_.integer(1 << 30)) % free_.size()];
    const auto width = static_cast<std::size_t>(floor_.frame.width);
    const std::size_t row = k / width;
    const Vector2d at = floor_.frame.to_world(
        {double(k % width) + draw_.uniform(0.0, 1.0), double(row) + draw_.uniform(0.0, 1.0)});
    return {at.x(), at.y(), draw_.uniform(-std::numbers::pi, std::numbers::pi)};
  }
  LaserScan scan_at(const Pose2& pose) const {
    LaserScan scan{.first_angle = -0.5 * std::numbers::pi,
                   .angle_step = std::numbers::pi / (kBeams - 1.0),
                   .max_range = kRange,
                   .ranges = {}};
    for (std::size_t beam = 0; beam < kBeams; ++beam) {
      const RayHit hit = rays_->cast(pose.translation(), pose.theta() + scan.angle(beam), kRange);
      scan.ranges.push_back(static_cast<float>(hit.range));
    }
    return scan;
  }

  Registry registry_;
  OccupancyGrid floor_;
  std::optional<RayCaster> rays_;
  std::vector<std::size_t> free_;
  test::Draw draw_{5};
};

TEST_F(FloorStudy, RaysEndInTheCellsOfExactTraversal) {
  const int count = asked("CAIRN_RAYS", 300000);
  constexpr int kBatch = 10000;
  double leaping = 0.0, plain = 0.0;  // [ms]
  for (int done = 0; done < count; done += kBatch) {
    std::vector<Pose2> from;
    for (int k = 0; k < kBatch; ++k) from.push_back(free_pose());
    std::vector<RayHit> fast, exact;
    fast.reserve(from.size());
    exact.reserve(from.size());
    auto begin = std::clock();
    for (const Pose2& pose : from)
      fast.push_back(rays_->cast(pose.translation(), pose.theta(), kRange));
    leaping += milliseconds_since(begin);
    begin = std::clock();
    for (const Pose2& pose : from)
      exact.push_back(rays_->cast_plainly(pose.translation(), pose.theta(), kRange));
    plain += milliseconds_since(begin);
    for (std::size_t k = 0; k < from.size(); ++k) {
      ASSERT_EQ(fast[k].hit, exact[k].hit);
      ASSERT_EQ(fast[k].range, exact[k].range);
      ASSERT_TRUE(!exact[k].hit || (fast[k].x == exact[k].x && fast[k].y == exact[k].y));
    }
  }
  std::cout << count << " rays: " << 1e-3 * count / leaping << " million a second, cell by cell "
            << 1e-3 * count / plain << ": " << plain / leaping << " times as many\n";
}

/// A drive in small steps; then the estimate moves.
TEST_F(FloorStudy, AMapThatIsKeptUpToDateIsTheOneComputedAnew) {
  const int count = asked("CAIRN_SCANS", 150);
  std::vector<Pose2> poses;
  std::vector<LaserScan> scans;
  while (static_cast<int>(poses.size()) < count) {
    Pose2 pose = free_pose();
    for (int k = 0; k < 25 && static_cast<int>(poses.size()) < count; ++k) {
      poses.push_back(pose);
      scans.push_back(scan_at(pose));
      const bool open = scans.back().ranges[kBeams / 2] > 1.0F;
      pose = pose * Pose2(open ? 0.4 : 0.0, 0.0, open ? draw_.uniform(-0.2, 0.2) : 0.3);
    }
  }
  for (const double side : {0.1, 0.05}) {
    const auto make = [&] {
      return registry_.make<Mapper>(parse_component("log_odds:resolution=" + std::to_string(side)));
    };
    const auto updated = make(), whole = make();
    std::vector<double> each;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const auto begin = std::clock();
      updated->add(poses[k], scans[k]);
      updated->map();
      each.push_back(milliseconds_since(begin));
      whole->add(poses[k], scans[k]);
    }
    EXPECT_EQ(updated->map().log_odds, whole->map().log_odds);
    EXPECT_EQ(updated->map().cells, whole->map().cells);
    EXPECT_EQ(updated->map().clearance, whole->map().clearance);
    EXPECT_EQ(updated->map().frontiers.size(), whole->map().frontiers.size());
    std::vector<Pose2> moved = poses;
    for (Pose2& pose : moved) pose = Pose2(0.3, -0.2, 0.05) * pose;
    const auto begin = std::clock();
    EXPECT_TRUE(updated->move(moved));
    const FloorMap& map = updated->map();
    const double anew = milliseconds_since(begin);
    std::ranges::sort(each);
    std::cout << "cells of " << side << " m, " << map.frame.width << " × " << map.frame.height
              << ": a scan added in " << each[each.size() / 2] << " ms (median), "
              << each[each.size() * 95 / 100] << " ms (95 %); " << count << " scans made anew in "
              << anew << " ms\n";
  }
}

}  // namespace
}  // namespace cairn
