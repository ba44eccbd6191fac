// SPDX-License-Identifier: BSD-3-Clause
#include "surface_scan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace cairn::icp {
namespace {

using Eigen::Vector2d;

/// Neighbouring points are on one surface if they are no further apart than a surface seen at this
/// slope (1 / sine of the angle of incidence) has them, and a margin for noise [m].
constexpr double kSteepest = 8.0, kNoiseGap = 0.1;
/// Weight of the scan's typical variance against a line's own, in points.
constexpr double kShrinkage = 4.0;
/// The line through both sides is taken unless one of a single side has a variance so much smaller.
constexpr double kBothSides = 2.0;
constexpr int kFewestPoints = 4;
/// Of a line's points, Σ s² at least [m²].
constexpr double kLeastSpread = 1e-6;
/// Ranges beyond this are as if nothing had been hit [m].
constexpr double kFarthest = 200.0;
/// Least of what `slope` says: grazing beams are no more precise across a surface.
constexpr double kGrazing = 0.1;
/// Surfaces with a larger slope determine the noise of ranges, if there are enough of them.
constexpr double kFrontal = 0.5;
constexpr std::ptrdiff_t kEnough = 20;
/// A line is fitted to a neighbourhood of this radius [m], at least so many standard deviations of
/// ranges, and at most so many times that radius; and to so many points on each side at least.
constexpr double kRadius = 0.25, kNoiseRadius = 8.0, kLongest = 2.0;
constexpr int kNeighbours = 3;

/// Neighbouring points: [first, last].
struct Window {
  int first = 0, last = 0;
  int count() const { return last - first + 1; }
};

/// Sums over the points before each, from which any window's moments follow.
class Moments {
 public:
  explicit Moments(std::span<const Vector2d> points) : sums_(points.size() + 1) {
    for (std::size_t k = 0; k < points.size(); ++k) {
      const double x = points[k].x(), y = points[k].y();
      sums_[k + 1] = {sums_[k][0] + x, sums_[k][1] + y, sums_[k][2] + x * x, sums_[k][3] + x * y,
                      sums_[k][4] + y * y};
    }
  }
  struct Of {
    Vector2d mean;
    double xx, xy, yy;
    double half_trace() const { return 0.5 * (xx + yy); }
    double half_gap() const { return std::hypot(0.5 * (xx - yy), xy); }
    double along() const { return half_trace() + half_gap(); }
    double across() const { return std::max(0.0, half_trace() - half_gap()); }
  };
  Of of(const Window& window) const {
    const auto& a = sums_[static_cast<std::size_t>(window.first)];
    const auto& b = sums_[static_cast<std::size_t>(window.last) + 1];
    const double n = window.count(), x = (b[0] - a[0]) / n, y = (b[1] - a[1]) / n;
    return {{x, y}, b[2] - a[2] - n * x * x, b[3] - a[3] - n * x * y, b[4] - a[4] - n * y * y};
  }
  double variance(const Window& window) const {
    if (window.count() < kFewestPoints) return std::numeric_limits<double>::infinity();
    return of(window).across() / (window.count() - 2);
  }

 private:
  std::vector<std::array<double, 5>> sums_;
};

SurfaceLine line_through(const Moments& moments, const Window& window,
                         std::span<const Vector2d> points) {
  const Moments::Of sums = moments.of(window);
  const double angle = 0.5 * std::atan2(2.0 * sums.xy, sums.xx - sums.yy);
  SurfaceLine line;
  line.centre = sums.mean;
  line.tangent = {std::cos(angle), std::sin(angle)};
  line.normal = {-line.tangent.y(), line.tangent.x()};
  if (line.normal.dot(line.centre) > 0.0) line.normal = -line.normal;
  const double s = line.tangent.dot(points[static_cast<std::size_t>(window.first)] - line.centre);
  const double t = line.tangent.dot(points[static_cast<std::size_t>(window.last)] - line.centre);
  line.begin = std::min(s, t);
  line.end = std::max(s, t);
  line.spread = sums.along();
  line.variance = sums.across() / (window.count() - 2);
  line.first = window.first;
  line.count = window.count();
  return line;
}

/// The part of a range's variance that is across a surface: (n · d)², d along the beam.
double slope(const Vector2d& normal, const Vector2d& point) {
  const double across = normal.dot(point);
  return std::max(kGrazing, across * across / point.squaredNorm());
}

/// The line's variance, such that the median over many is the true one (Wilson and Hilferty).
double unbiased_median(const SurfaceLine& line) {
  return line.variance / std::pow(1.0 - 2.0 / (9.0 * (line.count - 2)), 3);
}

}  // namespace

SurfaceScan::SurfaceScan(const LaserScan& scan, const SurfaceOptions& options) : scan_(scan) {
  find_points();
  fit_lines(options, kRadius);
  settle_variances(options);
  // Again, with the noise that was found: with more of it lines are longer.
  SurfaceOptions refined = options;
  refined.sigma = sigma();
  fit_lines(refined, std::clamp(kNoiseRadius * sigma(), kRadius, kLongest * kRadius));
  settle_variances(options);
  std::vector<Vector2d> kept;
  for (int k = 0; k < size(); ++k) {
    if (!line(k).exists()) continue;
    with_line_.push_back(k);
    kept.push_back(point(k));
  }
  tree_ = NearestPoints(std::move(kept));
}

void SurfaceScan::find_points() {
  if (!std::isfinite(scan_.first_angle) || !std::isfinite(scan_.angle_step)) scan_.ranges.clear();
  scan_.max_range = std::min(scan_.max_range, kFarthest);
  const float most = static_cast<float>(scan_.max_range);
  bool before = false;
  for (std::size_t beam = 0; beam < scan_.ranges.size(); ++beam) {
    float& range = scan_.ranges[beam];
    if (!(range > 0.0F)) range = std::numeric_limits<float>::quiet_NaN();
    if (range > most) range = most;
    const bool hit = range < most;
    if (hit) {
      const double angle = scan_.angle(beam);
      const Vector2d at = range * Vector2d(std::cos(angle), std::sin(angle));
      if (before) {
        const double nearer = std::min(at.norm(), points_.back().norm());
        continues_.back() = (at - points_.back()).norm() <
                            kSteepest * nearer * std::abs(scan_.angle_step) + kNoiseGap;
      }
      points_.push_back(at);
      continues_.push_back(false);
    }
    before = hit;
  }
}

void SurfaceScan::fit_lines(const SurfaceOptions& options, double radius) {
  const Moments moments(points_);
  lines_.assign(points_.size(), {});
  const double most = options.roughness * options.roughness;
  const double noise = options.sigma * options.sigma;
  for (int k = 0; k < size(); ++k) {
    // How far the surface reaches from the point to one side.
    const auto reach = [&](int step, int fewest) {
      int end = k;
      const auto goes_on = [&] {
        const int next = end + step;
        return next >= 0 && next < size() && continues(step > 0 ? end : next) &&
               (std::abs(next - k) <= fewest || (point(next) - point(k)).norm() <= radius);
      };
      while (goes_on()) end += step;
      return end;
    };
    Window best{reach(-1, kNeighbours), reach(1, kNeighbours)};
    const bool one_sided = k - best.first < 2 || best.last - k < 2;
    double least =
        one_sided ? std::numeric_limits<double>::infinity() : moments.variance(best) / kBothSides;
    if (least < noise) least = 0.0;  // as good as can be expected
    for (const Window& side :
         {Window{reach(-1, kNeighbours + 1), k}, Window{k, reach(1, kNeighbours + 1)}}) {
      const double variance = moments.variance(side);
      if (variance < least) {
        least = variance;
        best = side;
      }
    }
    if (moments.variance(best) < most && moments.of(best).along() > kLeastSpread)
      lines_[static_cast<std::size_t>(k)] = line_through(moments, best, points_);
  }
}

void SurfaceScan::settle_variances(const SurfaceOptions& options) {
  std::vector<double> of_range, frontal;
  for (int k = 0; k < size(); ++k) {
    if (!line(k).exists()) continue;
    const double across = slope(line(k).normal, point(k));
    of_range.push_back(unbiased_median(line(k)) / across);
    if (across > kFrontal) frontal.push_back(of_range.back());
  }
  if (std::ssize(frontal) >= kEnough) of_range = std::move(frontal);
  const double noise = options.sigma * options.sigma;
  range_variance_ = noise;
  if (of_range.empty()) return;
  const auto middle = of_range.begin() + std::ssize(of_range) / 2;
  std::nth_element(of_range.begin(), middle, of_range.end());
  range_variance_ = std::max(noise, *middle);
  for (int k = 0; k < size(); ++k) {
    SurfaceLine& line = lines_[static_cast<std::size_t>(k)];
    if (!line.exists()) continue;
    const double own = line.count - 2, across = slope(line.normal, point(k));
    line.variance =
        std::max(noise * across, (own * line.variance + kShrinkage * range_variance_ * across) /
                                     (own + kShrinkage));
  }
}

}  // namespace cairn::icp
