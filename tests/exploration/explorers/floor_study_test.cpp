// SPDX-License-Identifier: BSD-3-Clause
// Rays over a real floor, and maps of it: that they are right, and how long they take (printed, not
// tested). CAIRN_RAYS: so many rays; CAIRN_SCANS: so many scans.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
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

/// The traversal of Amanatides and Woo (1987) as it is usually written: a byte for each cell, and
/// sums of lengths. These are rounded at each border, so that its ranges are not exact to the last
/// bit; it is the speed to compare with.
class PlainTraversal {
 public:
  explicit PlainTraversal(const OccupancyGrid& grid)
      : frame_(grid.frame),
        width_(grid.frame.width + 2),
        stops_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(frame_.height + 2), 1) {
    for (int y = 0; y < frame_.height; ++y) {
      for (int x = 0; x < frame_.width; ++x) {
        const CellState state = CellThresholds{}.state(grid.occupancy[frame_.index(x, y)]);
        stops_[index(x, y)] = state != CellState::free;
      }
    }
  }
  void cast(const Pose2& at, std::span<const Vector2d> beams, double range,
            std::span<RayHit> hits) const {
    const Vector2d start = frame_.to_cells(at.translation());
    const double c = std::cos(at.theta()), s = std::sin(at.theta());
    for (std::size_t k = 0; k < beams.size(); ++k) {
      const Vector2d& beam = beams[k];
      hits[k] = cast(start, c * beam.x() - s * beam.y(), s * beam.x() + c * beam.y(), range);
    }
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y + 1) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x + 1);
  }
  RayHit cast(const Vector2d& start, double dx, double dy, double range) const {
    const double length = range / frame_.resolution;
    int x = static_cast<int>(start.x()), y = static_cast<int>(start.y());
    const int step_x = dx > 0.0 ? 1 : -1, step_y = dy > 0.0 ? 1 : -1;
    const double each_x = std::abs(1.0 / dx), each_y = std::abs(1.0 / dy);
    double next_x = (dx > 0.0 ? x + 1 - start.x() : start.x() - x) * each_x;
    double next_y = (dy > 0.0 ? y + 1 - start.y() : start.y() - y) * each_y;
    const std::uint8_t* cell = stops_.data() + index(x, y);
    double at = 0.0;
    while (*cell == 0) {
      if (next_x <= next_y) {
        at = next_x;
        next_x += each_x;
        x += step_x;
        cell += step_x;
      } else {
        at = next_y;
        next_y += each_y;
        y += step_y;
        cell += step_y * static_cast<std::ptrdiff_t>(width_);
      }
      if (at > length) return {.range = range};
    }
    return {.range = at * frame_.resolution, .x = x, .y = y, .hit = true};
  }

  GridFrame frame_;
  int width_;
  std::vector<std::uint8_t> stops_;
};

bool same(const RayHit& a, const RayHit& b) {
  return a.hit == b.hit && a.range == b.range && a.x == b.x && a.y == b.y;
}

TEST_F(FloorStudy, RaysEndInTheCellsOfExactTraversal) {
  const auto scans = static_cast<std::size_t>(asked("CAIRN_RAYS", 100000)) / kBeams + 1;
  constexpr std::size_t kBatch = 100;  // scans that are timed together
  const std::vector<Vector2d> beams = beam_directions({.beams = kBeams, .range = kRange});
  const PlainTraversal plainly(floor_);
  std::vector<std::string> sets;
  std::vector<RayCaster> casters;
  for (const char* kernels : {"portable", "avx2", "avx512"}) {
    try {
      casters.emplace_back(floor_, CellThresholds{}, kernels);
      sets.emplace_back(kernels);
    } catch (const Error&) {  // this machine cannot run them
    }
  }
  std::vector<std::vector<RayHit>> exact(kBatch, std::vector<RayHit>(kBeams)), hits = exact;
  std::vector<double> times(casters.size() + 2);  // [ms]
  std::int64_t rays = 0, met = 0, apart = 0;
  for (std::size_t done = 0; done < scans; done += kBatch) {
    std::vector<Pose2> from;
    for (std::size_t k = 0; k < kBatch; ++k) from.push_back(free_pose());
    const auto time = [&](double& sum, const auto& cast) {
      const auto begin = std::clock();
      for (std::size_t k = 0; k < kBatch; ++k) cast(from[k], k);
      sum += milliseconds_since(begin);
    };
    time(times[0], [&](const Pose2& at, std::size_t k) {
      casters[0].cast_plainly(at.translation(), at.theta(), beams, kRange, exact[k]);
    });
    time(times[1],
         [&](const Pose2& at, std::size_t k) { plainly.cast(at, beams, kRange, hits[k]); });
    for (std::size_t k = 0; k < kBatch; ++k) {
      for (std::size_t beam = 0; beam < kBeams; ++beam) {
        const RayHit &a = hits[k][beam], &b = exact[k][beam];
        apart += a.hit != b.hit || a.x != b.x || a.y != b.y || std::abs(a.range - b.range) > 1e-9;
        met += b.hit;
        ++rays;
      }
    }
    for (std::size_t set = 0; set < sets.size(); ++set) {
      time(times[set + 2], [&](const Pose2& at, std::size_t k) {
        casters[set].cast(at.translation(), at.theta(), beams, kRange, hits[k]);
      });
      for (std::size_t k = 0; k < kBatch; ++k)
        ASSERT_TRUE(std::ranges::equal(hits[k], exact[k], same)) << sets[set];
    }
  }
  const auto count = static_cast<double>(rays);
  EXPECT_GT(static_cast<double>(met), 0.9 * count);
  EXPECT_LE(static_cast<double>(apart), 1e-6 * count);
  const auto rate = [&](double time) { return 1e-3 * count / time; };
  std::cout << count << " rays; million a second: exact traversal " << rate(times[0])
            << ", with sums of lengths " << rate(times[1]) << " (another cell in " << apart << ")";
  for (std::size_t set = 0; set < sets.size(); ++set) {
    std::cout << ", " << sets[set] << " " << rate(times[set + 2]) << " ("
              << std::min(times[0], times[1]) / times[set + 2] << " times as many)";
  }
  std::cout << "\n";
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
