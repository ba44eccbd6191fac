// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Points of the plane in square buckets, which are numbered as they are added: the nearest one,
/// and those within a distance. Of points of even density each takes constant time.
class CAIRN_API PointBuckets {
 public:
  /// The box that holds all points, and the side of a bucket, above zero [m].
  PointBuckets(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double side);

  void add(const Eigen::Vector2d& point);
  int size() const { return static_cast<int>(points_.size()); }
  /// The number of the nearest point, the lowest of several; −1: there is none.
  int nearest(const Eigen::Vector2d& to) const;
  /// The numbers of the points within a distance, ascending.
  void within(const Eigen::Vector2d& of, double distance, std::vector<int>& found) const;

 private:
  Eigen::Vector2i bucket_of(const Eigen::Vector2d& point) const;
  const std::vector<int>& bucket(int x, int y) const {
    return buckets_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                    static_cast<std::size_t>(x)];
  }

  Eigen::Vector2d low_;
  double side_;
  int width_, height_;
  std::vector<std::vector<int>> buckets_;
  std::vector<Eigen::Vector2d> points_;
};

}  // namespace cairn
