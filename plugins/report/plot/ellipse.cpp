// SPDX-License-Identifier: BSD-3-Clause
#include "ellipse.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cairn::plot {
namespace {

constexpr int kCorners = 24;

}  // namespace

PlanarCovariance projected(const std::array<std::array<double, 3>, 2>& P, const float* upper) {
  const double xx = upper[0], xy = upper[1], xz = upper[2], yy = upper[3], yz = upper[4],
               zz = upper[5];
  const auto product = [&](const std::array<double, 3>& a, const std::array<double, 3>& b) {
    return a[0] * (xx * b[0] + xy * b[1] + xz * b[2]) + a[1] * (xy * b[0] + yy * b[1] + yz * b[2]) +
           a[2] * (xz * b[0] + yz * b[1] + zz * b[2]);
  };
  return {product(P[0], P[0]), product(P[0], P[1]), product(P[1], P[1])};
}

/// The unit circle by a Cholesky factor L of S = L Lᵀ: any square root of S makes the same ellipse.
std::vector<std::array<double, 2>> ellipse(const PlanarCovariance& S, double sigmas) {
  if (!(std::isfinite(S.xx) && std::isfinite(S.xy) && S.xx >= 0 && S.yy >= 0)) return {};
  const double l11 = std::sqrt(S.xx), l21 = l11 > 0 ? S.xy / l11 : 0;
  const double l22 = std::sqrt(std::max(0.0, S.yy - l21 * l21));
  std::vector<std::array<double, 2>> corners;
  for (int k = 0; k < kCorners; ++k) {
    const double angle = 2 * std::numbers::pi * k / kCorners;
    const double u = sigmas * std::cos(angle), v = sigmas * std::sin(angle);
    corners.push_back({l11 * u, l21 * u + l22 * v});
  }
  return corners;
}

}  // namespace cairn::plot
