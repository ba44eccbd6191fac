// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/dubins_curve.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Core>

namespace cairn {
namespace {

using Eigen::Vector2d;
using std::numbers::pi;

/// An angle in [0, 2π). One that rounding has put just below 0 is no full circle.
double turned(double angle) {
  constexpr double kRounding = 1e-12;
  const double result = angle - 2.0 * pi * std::floor(angle / (2.0 * pi));
  return result > 2.0 * pi - kRounding ? 0.0 : result;
}

double angle_of(const Vector2d& v) { return std::atan2(v.y(), v.x()); }

/// A curve on arcs of radius 1: the angles of arcs, the length of a line.
struct UnitCurve {
  std::array<int, 3> turns;
  std::array<double, 3> parts;
};

/// The two circles that touch a pose, which is in their border and heads along it.
Vector2d centre(const Vector2d& at, double theta, int turn) {
  return at + turn * Vector2d(-std::sin(theta), std::cos(theta));
}

/// An arc, the common tangent of two circles, and an arc. The circles are left of the vehicle
/// (turn 1) or right of it (−1), so that the tangent is an inner one where they differ: with ψ its
/// heading, n to its left and s its length, the second centre less the first is
/// s (cos ψ, sin ψ) + (second − first) n.
std::optional<UnitCurve> with_line(const Vector2d& to, double theta, int first, int second) {
  const Vector2d apart = centre(to, theta, second) - centre(Vector2d::Zero(), 0.0, first);
  const double aside = second - first;
  const double squared = apart.squaredNorm() - aside * aside;
  if (squared < 0.0) return std::nullopt;
  const double line = std::sqrt(squared);
  const double psi = angle_of(apart) - std::atan2(aside, line);
  return UnitCurve{.turns = {first, 0, second},
                   .parts = {turned(first * psi), line, turned(second * (theta - psi))}};
}

/// Three arcs, the first and last to the right. The middle circle touches both others: `side` is on
/// which side of the line between their centres it lies.
std::optional<UnitCurve> with_left_arc(const Vector2d& to, double theta, int side) {
  const Vector2d first = centre(Vector2d::Zero(), 0.0, -1), last = centre(to, theta, -1);
  const Vector2d apart = last - first;
  constexpr double kFarthest = 4.0;  // the middle circle between them
  const double distance = apart.norm();
  if (distance > kFarthest) return std::nullopt;
  const double alpha = angle_of(apart) + side * std::acos(distance / kFarthest);
  const Vector2d middle = first + 2.0 * Vector2d(std::cos(alpha), std::sin(alpha));
  const double beta = angle_of(last - middle);
  // Headings where the circles touch.
  const double onto = alpha - 0.5 * pi, off = beta + 0.5 * pi;
  return UnitCurve{.turns = {-1, 1, -1},
                   .parts = {turned(-onto), turned(off - onto), turned(off - theta)}};
}

UnitCurve mirrored(UnitCurve curve) {
  for (int& turn : curve.turns) turn = -turn;
  return curve;
}

double length_of(const UnitCurve& curve) {
  return curve.parts[0] + curve.parts[1] + curve.parts[2];
}

/// The shorter one of two.
void keep_shorter(std::optional<UnitCurve>& best, const std::optional<UnitCurve>& other) {
  if (other && (!best || length_of(*other) < length_of(*best))) best = other;
}

}  // namespace

Pose2 along_arc(double curvature, double length) {
  const double turn = curvature * length;
  // The chord, and its direction: half of the turn.
  const double half = 0.5 * turn;
  constexpr double kSmall = 1e-4;
  const double ratio = std::abs(half) < kSmall ? 1.0 - half * half / 6.0 : std::sin(half) / half;
  return {length * ratio * std::cos(half), length * ratio * std::sin(half), turn};
}

Pose2 DubinsCurve::at(double distance) const {
  Pose2 result;
  for (std::size_t k = 0; k < lengths.size(); ++k) {
    const double part = std::clamp(distance, 0.0, lengths[k]);
    result = result * along_arc(turns[k] / radius, part);
    distance -= lengths[k];
  }
  return result;
}

std::vector<DubinsCurve> dubins_curves(const Pose2& to, double radius) {
  const Vector2d end = to.translation() / radius;
  const double theta = to.theta();
  std::vector<DubinsCurve> curves;
  const auto add = [&](const std::optional<UnitCurve>& curve) {
    if (!curve) return;
    DubinsCurve found{.turns = curve->turns, .radius = radius};
    std::ranges::transform(curve->parts, found.lengths.begin(),
                           [&](double part) { return radius * part; });
    curves.push_back(found);
  };
  for (const int first : {1, -1}) {
    for (const int second : {1, -1}) add(with_line(end, theta, first, second));
  }
  std::optional<UnitCurve> rlr, lrl;
  for (const int side : {1, -1}) {
    keep_shorter(rlr, with_left_arc(end, theta, side));
    // The other word is that of the mirror image.
    keep_shorter(lrl, with_left_arc({end.x(), -end.y()}, -theta, side));
  }
  add(rlr);
  if (lrl) add(mirrored(*lrl));
  std::ranges::stable_sort(curves, {}, &DubinsCurve::length);
  return curves;
}

}  // namespace cairn
