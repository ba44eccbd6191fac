// SPDX-License-Identifier: BSD-3-Clause
#include "scan_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace cairn::test {
namespace {

using Eigen::Vector2d;

constexpr double kClearance = 0.25;  // [m]

std::vector<bool> clear_cells(const OccupancyGrid& floor) {
  const GridFrame& frame = floor.frame;
  const CellThresholds thresholds;
  const int reach = static_cast<int>(std::ceil(kClearance / frame.resolution));
  const auto is_free = [&](int x, int y) {
    return frame.contains(x, y) &&
           thresholds.state(floor.occupancy[frame.index(x, y)]) == CellState::free;
  };
  std::vector<bool> clear(static_cast<std::size_t>(frame.size()));
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      bool all = is_free(x, y);
      for (int v = -reach; all && v <= reach; ++v) {
        for (int u = -reach; all && u <= reach; ++u) all = is_free(x + u, y + v);
      }
      clear[frame.index(x, y)] = all;
    }
  }
  return clear;
}

}  // namespace

bool put_person_in(LaserScan& scan, double width, double sigma, Sampler& random) {
  constexpr int kTries = 100, kFewest = 3;  // beams
  const double radius = 0.5 * width;
  for (int tries = 0; tries < kTries; ++tries) {
    const double away = random.uniform(1.0, 2.5);
    const double towards = random.uniform(scan.angle(0), scan.angle(scan.ranges.size() - 1));
    std::vector<std::pair<std::size_t, double>> hits;
    for (std::size_t beam = 0; beam < scan.ranges.size(); ++beam) {
      const double aside = away * std::sin(scan.angle(beam) - towards);
      const double along = away * std::cos(scan.angle(beam) - towards);
      if (along <= 0.0 || std::abs(aside) >= radius) continue;
      const double range = along - std::sqrt(radius * radius - aside * aside);
      if (range < static_cast<double>(scan.ranges[beam])) hits.emplace_back(beam, range);
    }
    if (std::ssize(hits) < kFewest) continue;
    for (const auto& [beam, range] : hits) {
      const double noise = sigma * std::sqrt(12.0) * (random.uniform(0.0, 1.0) - 0.5);
      scan.ranges[beam] = static_cast<float>(range + noise);
    }
    return true;
  }
  return false;
}

void distort(LaserScan& scan, double bias, double step) {
  for (float& range : scan.ranges) {
    if (static_cast<double>(range) >= scan.max_range) continue;  // nothing in range
    const double measured = static_cast<double>(range) + bias;
    range = static_cast<float>(step > 0.0 ? step * std::round(measured / step) : measured);
  }
}

ScanPairs::ScanPairs(const OccupancyGrid& floor, std::uint64_t seed)
    : frame_(floor.frame), caster_(floor), clear_(clear_cells(floor)), random_(seed) {
  for (std::size_t k = 0; k < clear_.size(); ++k) {
    if (clear_[k]) standing_.push_back(k);
  }
}

bool ScanPairs::is_clear(const Vector2d& at) const {
  const Vector2d cell = frame_.to_cells(at);
  const int x = static_cast<int>(std::floor(cell.x())), y = static_cast<int>(std::floor(cell.y()));
  return frame_.contains(x, y) && clear_[frame_.index(x, y)];
}

double ScanPairs::gaussian() {
  const double u = random_.uniform(1e-12, 1.0), v = random_.uniform(0.0, 1.0);
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
}

LaserScan ScanPairs::scan(const Pose2& from, const LidarModel& lidar) {
  LaserScan scan{lidar.first_angle(), lidar.step(), lidar.range, {}};
  for (int beam = 0; beam < lidar.beams; ++beam) {
    const RayHit hit = caster_.cast(
        from.translation(), from.theta() + scan.angle(static_cast<std::size_t>(beam)), lidar.range);
    const double range = hit.hit ? hit.range + lidar.sigma * gaussian() : lidar.range;
    scan.ranges.push_back(static_cast<float>(range));
  }
  return scan;
}

ScanPair ScanPairs::draw(const LidarModel& lidar, const PairRange& range, const PairRange& off) {
  const auto within = [&](const PairRange& box) {
    const double x = random_.uniform(-box.position, box.position);
    const double y = random_.uniform(-box.position, box.position);
    return Pose2(x, y, random_.uniform(-box.angle, box.angle));
  };
  for (;;) {
    const std::size_t cell = standing_[static_cast<std::size_t>(
        random_.uniform(0.0, static_cast<double>(standing_.size())))];
    const int width = frame_.width, index = static_cast<int>(cell);
    const Vector2d at = frame_.centre(index % width, index / width);
    const Pose2 first(at.x(), at.y(), random_.uniform(-std::numbers::pi, std::numbers::pi));
    const Pose2 truth = within(range), second = first * truth;
    if (!is_clear(second.translation())) continue;
    const Vector2d way = second.translation() - at;
    if (caster_.cast(at, std::atan2(way.y(), way.x()), way.norm()).hit) continue;
    const Pose2 error = within(off);
    return {.earlier = scan(first, lidar),
            .later = scan(second, lidar),
            .truth = truth,
            .guess =
                Pose2(truth.x() + error.x(), truth.y() + error.y(), truth.theta() + error.theta())};
  }
}

}  // namespace cairn::test
