// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "point_to_line.hpp"
#include "surface_scan.hpp"

namespace cairn::icp {

struct CovarianceOptions {
  double unobserved = 1.0;  ///< standard deviation of a direction that is not observed [m]
  double tilt = 0.02;       ///< standard deviation of an unobserved direction [rad]
};

struct MatchCovariance {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of ξ in T exp(ξ)
  int unobserved = 0;  ///< directions that the scans do not determine
  Eigen::Vector3d weakest = Eigen::Vector3d::UnitX();  ///< the ξ with the least information [1 m]
  double scale = 1.0;  ///< of residuals, against their expected standard deviations
};

/// The covariance of a point-to-line match, from its matches after trimming.
///
/// The pose is that with Σ J r / σ_r² = 0, so its error is H⁻¹ Σ J r / σ_r², H = Σ J Jᵀ / σ_r². In
/// r are the noise of one point of the moving scan and that of all points of a line, and many
/// matches share the same ones: each point's total weight is summed before it is squared,
///
///     Σ = H⁻¹ (Σ_points a aᵀ σ²) H⁻¹,
///
/// with a the sum over the matches of J / σ_r² times the point's part in the residual. That is the
/// covariance of Censi (ICRA 2007) for independent ranges and fixed matches.
///
/// Directions are the eigenvectors of H, with angles times the root mean square distance of the
/// points as lengths. One is observed if its information is well above that of the noise of the
/// normals (S of `PointToLine`); what is left when that is subtracted is what counts. The others
/// have the standard deviation `unobserved`; how far that is across them, since their direction is
/// not known to better than `tilt`, is added to what is observed.
MatchCovariance match_covariance(const SurfaceScan& reference, const SurfaceScan& moving,
                                 const std::vector<PointMatch>& matches,
                                 const CovarianceOptions& options);

}  // namespace cairn::icp
