// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

namespace cairn::icp {

/// Finds the nearest of some points in the plane, by a k-d tree.
class NearestPoints {
 public:
  NearestPoints();
  explicit NearestPoints(std::vector<Eigen::Vector2d> points);
  NearestPoints(NearestPoints&&) noexcept;
  NearestPoints& operator=(NearestPoints&&) noexcept;
  ~NearestPoints();

  /// The index of the point nearest to `at` among those nearer than `radius` [m]; −1: none is.
  int nearest(const Eigen::Vector2d& at, double radius) const;

 private:
  struct Tree;
  std::unique_ptr<const Tree> tree_;  ///< null: no points
};

}  // namespace cairn::icp
