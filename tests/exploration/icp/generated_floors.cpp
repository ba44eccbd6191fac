// SPDX-License-Identifier: BSD-3-Clause
#include "generated_floors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "support/sampling.hpp"

namespace cairn::test {

using Eigen::Vector2d;

Walls& Walls::polygon(const std::vector<Vector2d>& corners) {
  for (std::size_t k = 0; k < corners.size(); ++k)
    segments.push_back({corners[k], corners[(k + 1) % corners.size()]});
  return *this;
}

double Walls::range(const Vector2d& from, double angle) const {
  const auto cross = [](const Vector2d& a, const Vector2d& b) {
    return a.x() * b.y() - a.y() * b.x();
  };
  const Vector2d d(std::cos(angle), std::sin(angle));
  double nearest = std::numeric_limits<double>::infinity();
  for (const Segment& wall : segments) {
    // from + r d = wall.from + u along
    const Vector2d along = wall.to - wall.from, offset = wall.from - from;
    const double determinant = cross(d, along);
    if (std::abs(determinant) < 1e-12) continue;
    const double r = cross(offset, along) / determinant, u = cross(offset, d) / determinant;
    if (r > 0.0 && u >= 0.0 && u <= 1.0) nearest = std::min(nearest, r);
  }
  return nearest;
}

LaserScan Walls::scan(const Pose2& from, const LidarModel& lidar) const {
  LaserScan scan{lidar.first_angle(), lidar.step(), lidar.range, {}};
  for (int beam = 0; beam < lidar.beams; ++beam) {
    const double angle = from.theta() + scan.angle(static_cast<std::size_t>(beam));
    scan.ranges.push_back(
        static_cast<float>(std::min(lidar.range, range(from.translation(), angle))));
  }
  return scan;
}

Walls furnished_room() {
  Walls walls;
  walls.polygon(
      {{0, 0}, {6, 0}, {6, 2.5}, {5, 4}, {3.2, 4}, {3.2, 4.6}, {2.2, 4.6}, {2.2, 4}, {0, 4}});
  walls.polygon({{4.2, 1.5}, {4.6, 1.5}, {4.6, 1.9}, {4.2, 1.9}});
  return walls;
}

Walls corridor() {
  Walls walls;
  walls.polygon({{-30, -1}, {30, -1}, {30, 1}, {-30, 1}});
  return walls;
}

LaserScan with_noise(LaserScan scan, double sigma, unsigned seed) {
  Sampler random(seed);
  for (float& range : scan.ranges) {
    const double u = random.uniform(1e-12, 1.0), v = random.uniform(0.0, 1.0);
    if (range < scan.max_range)
      range += static_cast<float>(sigma * std::sqrt(-2.0 * std::log(u)) *
                                  std::cos(2.0 * std::numbers::pi * v));
  }
  return scan;
}

}  // namespace cairn::test
