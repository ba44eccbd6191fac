// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

namespace cairn::plot {

/// A covariance in the plane of the plot.
struct PlanarCovariance {
  double xx = 0, xy = 0, yy = 0;
};

/// P S Pᵀ of a symmetric 3 × 3 matrix S, whose upper triangle stands by rows, and P with two rows.
PlanarCovariance projected(const std::array<std::array<double, 3>, 2>& P, const float* upper);

/// Corners of the ellipse pᵀ S⁻¹ p = k² about the origin, k = `sigmas`, each x and y; a line where
/// S has rank one. Empty where S is no covariance.
std::vector<std::array<double, 2>> ellipse(const PlanarCovariance& S, double sigmas);

}  // namespace cairn::plot
