// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/point_buckets.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn {

using Eigen::Vector2d;

PointBuckets::PointBuckets(const Vector2d& low, const Vector2d& high, double side)
    : low_(low),
      side_(side),
      width_(static_cast<int>((high.x() - low.x()) / side) + 1),
      height_(static_cast<int>((high.y() - low.y()) / side) + 1),
      buckets_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)) {}

Eigen::Vector2i PointBuckets::bucket_of(const Vector2d& point) const {
  const auto within = [&](double value, int count) {
    return static_cast<int>(std::clamp(std::floor(value / side_), 0.0, count - 1.0));
  };
  return {within(point.x() - low_.x(), width_), within(point.y() - low_.y(), height_)};
}

void PointBuckets::add(const Vector2d& point) {
  const Eigen::Vector2i at = bucket_of(point);
  buckets_[static_cast<std::size_t>(at.y()) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(at.x())]
      .push_back(size());
  points_.push_back(point);
}

int PointBuckets::nearest(const Vector2d& to) const {
  const Eigen::Vector2i middle = bucket_of(to);
  int best = -1;
  double least = std::numeric_limits<double>::infinity();
  const auto visit = [&](int x, int y) {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return;
    for (const int index : bucket(x, y)) {
      const double apart = (points_[static_cast<std::size_t>(index)] - to).squaredNorm();
      if (apart < least || (apart == least && index < best)) {
        best = index;
        least = apart;
      }
    }
  };
  // Rings of buckets; all points of ring k are farther away than k − 1 sides.
  for (int ring = 0; ring <= std::max(width_, height_); ++ring) {
    const double room = side_ * (ring - 1);
    if (best >= 0 && ring > 0 && least < room * room) break;
    for (int x = middle.x() - ring; x <= middle.x() + ring; ++x) {
      visit(x, middle.y() - ring);
      if (ring > 0) visit(x, middle.y() + ring);
    }
    for (int y = middle.y() - ring + 1; y < middle.y() + ring; ++y) {
      visit(middle.x() - ring, y);
      visit(middle.x() + ring, y);
    }
  }
  return best;
}

void PointBuckets::within(const Vector2d& of, double distance, std::vector<int>& found) const {
  found.clear();
  const Eigen::Vector2i low = bucket_of(of - Vector2d::Constant(distance));
  const Eigen::Vector2i high = bucket_of(of + Vector2d::Constant(distance));
  for (int y = low.y(); y <= high.y(); ++y) {
    for (int x = low.x(); x <= high.x(); ++x) {
      for (const int index : bucket(x, y)) {
        if ((points_[static_cast<std::size_t>(index)] - of).squaredNorm() <= distance * distance)
          found.push_back(index);
      }
    }
  }
  std::ranges::sort(found);
}

}  // namespace cairn
