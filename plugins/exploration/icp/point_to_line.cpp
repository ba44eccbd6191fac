// SPDX-License-Identifier: BSD-3-Clause
#include "point_to_line.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <Eigen/LU>

namespace cairn::icp {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// With fewer matches there is no step.
constexpr std::ptrdiff_t kFewest = 6;
/// Steps that are shorter than this end the iterations [m, rad].
constexpr double kConverged = 1e-4;
/// Beyond the outermost point of a line by at most this part of its length, if it has few points.
constexpr double kBeyond = 0.1;
/// The last distance is at least so many standard deviations of residuals.
constexpr double kNoise = 3.5;
/// Longest step [m, rad].
constexpr double kLongest = 0.3;
/// Factor on the distance of matches per iteration.
constexpr double kShrink = 0.7;
/// Part of the matches that is used.
constexpr double kUsed = 0.95;
/// Largest angle between the surfaces at a point and its line [rad].
constexpr double kFacing = 0.7;

/// ∂(v · T exp(ξ) p)/∂ξ for a direction v in the reference's frame, turned into the moving one's.
Vector3d derivative(const Vector2d& v, const Vector2d& p) {
  return {v.x(), v.y(), v.y() * p.x() - v.x() * p.y()};
}

double square_of(const PointMatch& match) {
  return match.residual * match.residual / match.variance;
}

/// One step of Gauss-Newton; zero if the matches do not determine one.
Vector3d step(const std::vector<PointMatch>& matches, const SurfaceScan& reference,
              const SurfaceScan& moving) {
  Matrix3d H = Matrix3d::Zero();
  Vector3d g = Vector3d::Zero();
  for (const PointMatch& match : matches) {
    const double weight = 1.0 / match.variance;
    H += weight * match.J * match.J.transpose();
    const SurfaceScan& lines = match.inverse ? moving : reference;
    H += weight * lines.line(match.line).angle_variance() * match.J_turn * match.J_turn.transpose();
    g += weight * match.residual * match.J;
  }
  H += 1e-9 * H.trace() * Matrix3d::Identity();
  Vector3d xi = -H.inverse() * g;
  if (!xi.allFinite()) return Vector3d::Zero();
  const double longest = xi.cwiseAbs().maxCoeff();
  if (longest > kLongest) xi *= kLongest / longest;
  return xi;
}

}  // namespace

void trim(std::vector<PointMatch>& matches) {
  const auto kept = static_cast<std::ptrdiff_t>(std::ceil(kUsed * std::ssize(matches)));
  if (kept >= std::ssize(matches)) return;
  std::ranges::nth_element(matches, matches.begin() + kept, {}, [](const PointMatch& match) {
    return std::tuple(square_of(match), match.inverse, match.point);
  });
  matches.erase(matches.begin() + kept, matches.end());
}

PointToLine::PointToLine(const SurfaceScan& reference, const SurfaceScan& moving,
                         double last_distance)
    : reference_(reference),
      moving_(moving),
      last_distance_(std::max(last_distance, kNoise * std::sqrt(reference.range_variance() +
                                                                moving.range_variance()))) {}

std::vector<PointMatch> PointToLine::match(const Pose2& pose, double distance) const {
  std::vector<PointMatch> matches;
  matches.reserve(static_cast<std::size_t>(moving_.size()) +
                  static_cast<std::size_t>(reference_.size()));
  match(reference_, moving_, pose, distance, false, matches);
  match(moving_, reference_, pose.inverse(), distance, true, matches);
  return matches;
}

void PointToLine::match(const SurfaceScan& lines, const SurfaceScan& points, const Pose2& pose,
                        double distance, bool inverse, std::vector<PointMatch>& matches) const {
  const Matrix2d R = pose.rotation().matrix();
  const Vector2d t = pose.translation();
  const double facing = std::cos(kFacing);
  for (int k = 0; k < points.size(); ++k) {
    const SurfaceLine& own = points.line(k);
    if (!own.exists()) continue;
    const Vector2d at = R * points.point(k) + t;
    const int found = lines.nearest_line(at, distance);
    if (found < 0) continue;
    const SurfaceLine& line = lines.line(found);
    if (line.normal.dot(R * own.normal) < facing) continue;
    const Vector2d from_centre = at - line.centre;
    const double along = line.tangent.dot(from_centre);
    const double beyond = kBeyond * (line.end - line.begin);
    if (along < line.begin - beyond || along > line.end + beyond) continue;
    PointMatch match{.inverse = inverse,
                     .point = k,
                     .line = found,
                     .along = along,
                     .residual = line.normal.dot(from_centre),
                     .variance = own.variance + line.variance * line.leverage(along, along),
                     .J = {},
                     .J_turn = {}};
    if (inverse) {  // T⁻¹ q moves by exp(−ξ)
      match.J = -derivative(line.normal, at);
      match.J_turn = -derivative(line.tangent, at);
    } else {
      match.J = derivative(R.transpose() * line.normal, points.point(k));
      match.J_turn = derivative(R.transpose() * line.tangent, points.point(k));
    }
    matches.push_back(match);
  }
}

Refinement PointToLine::refine(const Pose2& start, double distance, int iterations) const {
  Refinement result{.pose = start, .matches = {}};
  distance = std::max(distance, last_distance_);
  for (; result.iterations < iterations && !result.converged; ++result.iterations) {
    std::vector<PointMatch> matches = match(result.pose, distance);
    if (std::ssize(matches) < kFewest) break;
    trim(matches);
    const Vector3d xi = step(matches, reference_, moving_);
    result.pose = result.pose.retract(xi);
    result.converged = distance <= last_distance_ && xi.cwiseAbs().maxCoeff() < kConverged;
    distance = std::max(last_distance_, distance * kShrink);
  }
  result.matches = match(result.pose, last_distance_);
  return result;
}

}  // namespace cairn::icp
