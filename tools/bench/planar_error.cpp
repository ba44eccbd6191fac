// SPDX-License-Identifier: BSD-3-Clause
#include "planar_error.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace cairn::performance {

PlanarPose compose(const PlanarPose& a, const PlanarPose& b) {
  const double c = std::cos(a.theta), s = std::sin(a.theta);
  return {a.x + c * b.x - s * b.y, a.y + s * b.x + c * b.y,
          std::remainder(a.theta + b.theta, 2.0 * std::numbers::pi)};
}

PlanarPose between(const PlanarPose& a, const PlanarPose& b) {
  const double c = std::cos(a.theta), s = std::sin(a.theta);
  const double x = b.x - a.x, y = b.y - a.y;
  return {c * x + s * y, c * y - s * x, std::remainder(b.theta - a.theta, 2.0 * std::numbers::pi)};
}

PlanarError planar_error(std::span<const PlanarPose> estimate, std::span<const PlanarPose> truth) {
  const auto n = static_cast<double>(estimate.size());
  if (estimate.empty()) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    return {kNone, kNone};
  }
  PlanarPose from, to;  // the means
  for (std::size_t k = 0; k < estimate.size(); ++k) {
    from.x += estimate[k].x / n;
    from.y += estimate[k].y / n;
    to.x += truth[k].x / n;
    to.y += truth[k].y / n;
  }
  double dot = 0.0, cross = 0.0;
  for (std::size_t k = 0; k < estimate.size(); ++k) {
    const double ex = estimate[k].x - from.x, ey = estimate[k].y - from.y;
    const double tx = truth[k].x - to.x, ty = truth[k].y - to.y;
    dot += ex * tx + ey * ty;
    cross += ex * ty - ey * tx;
  }
  to.theta = std::atan2(cross, dot);  // Horn's rotation, in the plane
  PlanarError sum;
  for (std::size_t k = 0; k < estimate.size(); ++k) {
    const PlanarPose placed = compose(to, between(from, estimate[k]));
    const PlanarPose error = between(truth[k], placed);
    sum.translation += error.x * error.x + error.y * error.y;
    sum.rotation += error.theta * error.theta;
  }
  return {std::sqrt(sum.translation / n), std::sqrt(sum.rotation / n)};
}

}  // namespace cairn::performance
