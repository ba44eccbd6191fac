// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/typed/pose2.hpp"
#include "surface_scan.hpp"

namespace cairn::icp {

/// A point of one scan that lies on a line of the other.
struct PointMatch {
  bool inverse = false;    ///< the point is of the reference and the line of the moving scan
  int point = 0;           ///< of the moving scan
  int line = 0;            ///< of the reference
  double along = 0.0;      ///< where on the line, from its centre [m]
  double residual = 0.0;   ///< distance from the line [m]
  double variance = 0.0;   ///< of the residual [m²]
  Eigen::Vector3d J;       ///< ∂residual/∂ξ
  Eigen::Vector3d J_turn;  ///< ∂J/∂(angle of the line's normal)
};

struct Refinement {
  Pose2 pose;
  std::vector<PointMatch> matches;  ///< at `pose`, before trimming
  int iterations = 0;
  bool converged = false;
};

/// Iterative closest points with distances of points from lines (Censi, An ICP variant using a
/// point-to-line metric, ICRA 2008). Minimises over the pose T of the moving scan, in the frame of
/// the reference,
///
///     Σ r² / σ_r²,    r = n · (T p − c),    T ← T exp(ξ),
///
/// where c and n are the centre and the normal of the reference's line nearest to T p; and likewise
/// for the reference's points q on lines of the moving scan, with r = n · (T⁻¹ q − c). A match
/// counts if the point is beside the line's own points, the surfaces face one way, and the distance
/// is below one that shrinks from iteration to iteration; of these the largest residuals are
/// trimmed.
///
/// Normals are noisy, so that even along a bare corridor the normal equations H have some
/// information, S = Σ J_turn J_turnᵀ σ_n²/σ_r² on average. A step solves (H + S) ξ = −g, which
/// hardly moves where there is no more than that.
class PointToLine {
 public:
  /// `last_distance`: largest from a point to its line in the last iterations [m].
  PointToLine(const SurfaceScan& reference, const SurfaceScan& moving, double last_distance = 0.1);

  /// `distance`: the same in the first iteration.
  Refinement refine(const Pose2& start, double distance, int iterations = 30) const;
  std::vector<PointMatch> match(const Pose2& pose, double distance) const;

 private:
  /// The points of one scan on lines of the other, with `pose` from it.
  void match(const SurfaceScan& lines, const SurfaceScan& points, const Pose2& pose,
             double distance, bool inverse, std::vector<PointMatch>& matches) const;

  const SurfaceScan& reference_;
  const SurfaceScan& moving_;
  double last_distance_;
};

/// Removes the 5 % with the largest weighted residuals.
void trim(std::vector<PointMatch>& matches);

}  // namespace cairn::icp
