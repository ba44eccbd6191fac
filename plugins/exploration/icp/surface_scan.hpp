// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/laser_scan.hpp"
#include "nearest_points.hpp"

namespace cairn::icp {

/// A straight piece of surface: the line through neighbouring points of a scan, by least squares.
struct SurfaceLine {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< of its points [m]
  Eigen::Vector2d tangent = Eigen::Vector2d::UnitX();
  Eigen::Vector2d normal = Eigen::Vector2d::UnitY();  ///< towards the lidar
  double begin = 0.0, end = 0.0;  ///< its outermost points, along the tangent from the centre [m]
  double spread = 0.0;       ///< Σ s² of its points, s along the tangent from the centre [m²]
  double variance = 0.0;     ///< of a point's distance from the line [m²]
  int first = 0, count = 0;  ///< its points; none: there is no line

  bool exists() const { return count > 0; }
  /// Of the angle of the normal [rad²].
  double angle_variance() const { return variance / spread; }
  /// Part of the point at s_point in the line's position at s: what one point's noise does there.
  double leverage(double s, double s_point) const { return 1.0 / count + s * s_point / spread; }
};

/// How surfaces are found in a scan.
struct SurfaceOptions {
  double sigma = 0.01;      ///< least standard deviation of a range [m]
  double roughness = 0.08;  ///< largest standard deviation of points from a line [m]
};

/// A laser scan prepared for matching: its points in the robot's frame, for each the line through
/// its neighbours, and a search tree.
///
/// Ranges beyond 200 m count as that: nothing was hit.
///
/// A line never reaches over a gap in the scan. For each point three are fitted, to the neighbours
/// on both sides and on either side alone; the one with the least variance is taken, so that lines
/// are not rounded at corners and edges.
class SurfaceScan {
 public:
  explicit SurfaceScan(const LaserScan& scan, const SurfaceOptions& options = {});

  int size() const { return static_cast<int>(points_.size()); }
  const Eigen::Vector2d& point(int k) const { return points_[static_cast<std::size_t>(k)]; }
  std::span<const Eigen::Vector2d> points() const { return points_; }
  /// The line at a point; `exists()` is false where there is none.
  const SurfaceLine& line(int k) const { return lines_[static_cast<std::size_t>(k)]; }
  int line_count() const { return static_cast<int>(with_line_.size()); }
  /// Whether point k + 1 is on the same surface as point k.
  bool continues(int k) const { return continues_[static_cast<std::size_t>(k)]; }
  /// Of a range, estimated from the points' distances from their lines [m²].
  double range_variance() const { return range_variance_; }
  /// Estimated standard deviation of ranges [m].
  double sigma() const { return std::sqrt(range_variance_); }
  /// Of a point's position across its surface [m²]; along the beam if it has no line.
  double point_variance(int k) const {
    return line(k).exists() ? line(k).variance : range_variance_;
  }
  /// The point with a line nearest to `at`, nearer than `radius` [m]; −1: none.
  int nearest_line(const Eigen::Vector2d& at, double radius) const {
    const int found = tree_.nearest(at, radius);
    return found < 0 ? -1 : with_line_[static_cast<std::size_t>(found)];
  }

  /// The scan itself: ranges above zero, at most its maximum; NaN where nothing was measured.
  const LaserScan& scan() const { return scan_; }

 private:
  void find_points();
  /// `radius`: of the neighbourhood that a line is fitted to [m].
  void fit_lines(const SurfaceOptions& options, double radius);
  void settle_variances(const SurfaceOptions& options);

  LaserScan scan_;
  std::vector<Eigen::Vector2d> points_;
  std::vector<bool> continues_;
  std::vector<SurfaceLine> lines_;
  std::vector<int> with_line_;
  double range_variance_ = 0.0;
  NearestPoints tree_;
};

}  // namespace cairn::icp
