// SPDX-License-Identifier: BSD-3-Clause
#include "proximity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace cairn::compact {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// P(x < bound) of x ~ N(mean, sigma²)
double probability_below(double bound, double mean, double sigma) {
  if (sigma <= 0.0) return bound > mean ? 1.0 : 0.0;
  return 0.5 * std::erfc((mean - bound) / (sigma * std::numbers::sqrt2));
}

/// The smallest x in [low, high] for which the rising `f(x)` is at least `level`.
template <class F>
double bisect(double low, double high, double level, const F& f) {
  for (int k = 0; k < 100 && high - low > 1e-14 * (1.0 + std::abs(high)); ++k) {
    const double middle = 0.5 * (low + high);
    (f(middle) >= level ? high : low) = middle;
  }
  return high;
}

Vector3d rotation_vector(const Matrix3d& R) {
  const Eigen::AngleAxisd turn(R);
  return turn.angle() * turn.axis();
}

/// J_r⁻¹(q): how the rotation vector of R exp(φ) changes with φ at 0.
Matrix3d inverse_right_jacobian(const Vector3d& q) {
  Matrix3d hat;
  hat << 0.0, -q.z(), q.y(), q.z(), 0.0, -q.x(), -q.y(), q.x(), 0.0;
  const double square = q.squaredNorm(), half = 0.5 * std::sqrt(square);
  const double factor =
      square < 1e-6 ? 1.0 / 12.0 + square / 720.0 : (1.0 - half / std::tan(half)) / square;
  return Matrix3d::Identity() + 0.5 * hat + factor * hat * hat;
}

struct Gaussian {
  double mean, sigma;
};

/// The angle of a rotation. Where it is zero its gradient has no direction; the largest variance
/// stands for all then.
Gaussian angle(const Vector3d& q, const Matrix3d& S) {
  const double norm = q.norm();
  const double variance =
      norm > 1e-9
          ? q.dot(S * q) / (norm * norm)
          : Eigen::SelfAdjointEigenSolver<Matrix3d>(S, Eigen::EigenvaluesOnly).eigenvalues()[2];
  return {norm, std::sqrt(std::max(0.0, variance))};
}

/// c = eᵀ R e, the cosine between the view directions (equation 20), for R exp(φ), φ ~ N(0, S). To
/// second order, c = c̄ + jᵀφ + φᵀKφ with w = Rᵀe, j = e × w, K = ¼(w eᵀ + e wᵀ) − ½(w·e) I. The
/// second order counts: where the directions agree, j vanishes.
Gaussian view_cosine(const Matrix3d& R, const Matrix3d& S, int axis) {
  const Vector3d e = Vector3d::Unit(axis), w = R.transpose() * e, j = e.cross(w);
  const Matrix3d K =
      0.25 * (w * e.transpose() + e * w.transpose()) - 0.5 * w.dot(e) * Matrix3d::Identity();
  const Matrix3d KS = K * S;
  const double variance = j.dot(S * j) + 2.0 * (KS * KS).trace();
  return {w.dot(e) + KS.trace(), std::sqrt(std::max(0.0, variance))};
}

}  // namespace

double probability_within(double mean, double sigma, double range) {
  if (sigma <= 0.0) return std::abs(mean) < range ? 1.0 : 0.0;
  const double scale = 1.0 / (sigma * std::numbers::sqrt2);
  // Of |μ|, so that the difference is between the two smaller numbers.
  const double m = std::abs(mean);
  return 0.5 * (std::erfc((m - range) * scale) - std::erfc((m + range) * scale));
}

double range_within(double mean, double sigma, double probability) {
  const double m = std::abs(mean);
  if (sigma <= 0.0) return m;
  double high = m + sigma;
  while (probability_within(m, sigma, high) < probability) high *= 2.0;
  return bisect(0.0, high, probability, [&](double v) { return probability_within(m, sigma, v); });
}

double reach(double probability) {
  if (probability <= 0.0) return kInfinity;
  if (probability >= 0.5) return 1.0;
  // For m > 1 the probability is largest at σ² = 2m / ln((m+1)/(m−1)), where its derivative is 0.
  const auto most = [](double m) {
    const double sigma = std::sqrt(2.0 * m / std::log((m + 1.0) / (m - 1.0)));
    return probability_within(m, sigma, 1.0);
  };
  double high = 2.0;
  while (most(high) > probability) high *= 2.0;
  return bisect(1.0, high, -probability, [&](double m) { return m <= 1.0 ? -0.5 : -most(m); });
}

double SensorRange::radius(int dimension) const {
  double sum = 0.0;
  for (int r = 0; r < dimension; ++r) sum += translation[r] * translation[r];
  return reach(probability) * std::sqrt(sum);
}

DistanceTest::DistanceTest(const RigidGroup& group, const SensorRange& range)
    : group_(&group), range_(range), reach_(reach(range.probability)) {
  if (group.dimension() == 2) range_.test = RotationTest::elements;  // there is one angle
}

bool DistanceTest::possible(const Pose& d) const {
  if (reach_ == kInfinity) return true;
  for (int r = 0; r < group_->dimension(); ++r) {
    if (std::abs(d.t[r]) > reach_ * range_.translation[r]) return false;
  }
  const double most = reach_ * range_.rotation;
  if (most >= std::numbers::pi || range_.test == RotationTest::view) return true;
  const Vector3d q = rotation_vector(d.R);
  return (range_.test == RotationTest::elements ? q.lpNorm<Eigen::Infinity>() : q.norm()) <= most;
}

Dimensions DistanceTest::dimensions(const Displacement& d) const {
  const Eigen::Matrix<double, 6, 6> twist = group_->twist_covariance(d.covariance);
  const Matrix3d T = d.at.R * twist.topLeftCorner<3, 3>() * d.at.R.transpose(),
                 S = twist.bottomRightCorner<3, 3>();
  Dimensions out;
  out.translations = group_->dimension();
  for (int r = 0; r < out.translations; ++r) {
    out.t_mean[r] = d.at.t[r];
    out.t_sigma[r] = std::sqrt(std::max(0.0, T(r, r)));
  }
  const Vector3d q = rotation_vector(d.at.R);
  const auto set = [&](int r, const Gaussian& x) {
    out.r_mean[r] = x.mean;
    out.r_sigma[r] = x.sigma;
  };
  if (out.translations == 2) {
    out.rotations = 1;
    set(0, {q.z(), std::sqrt(std::max(0.0, S(2, 2)))});
  } else if (range_.test == RotationTest::elements) {
    out.rotations = 3;
    const Matrix3d J = inverse_right_jacobian(q), Q = J * S * J.transpose();
    for (int r = 0; r < 3; ++r) set(r, {q[r], std::sqrt(std::max(0.0, Q(r, r)))});
  } else {
    out.rotations = 1;
    set(0,
        range_.test == RotationTest::view ? view_cosine(d.at.R, S, range_.view_axis) : angle(q, S));
  }
  return out;
}

double DistanceTest::rotation_probability(double mean, double sigma) const {
  sigma *= range_.noise_scale;
  if (range_.rotation >= std::numbers::pi) return 1.0;  // no angle is larger
  if (range_.test != RotationTest::view) return probability_within(mean, sigma, range_.rotation);
  return 1.0 - probability_below(std::cos(range_.rotation), mean, sigma);
}

bool DistanceTest::passes(const Dimensions& d) const {
  if (range_.probability <= 0.0) return true;
  for (int r = 0; r < d.translations; ++r) {
    const double sigma = range_.noise_scale * d.t_sigma[r];
    if (!(probability_within(d.t_mean[r], sigma, range_.translation[r]) > range_.probability))
      return false;
  }
  for (int r = 0; r < d.rotations; ++r) {
    if (!(rotation_probability(d.r_mean[r], d.r_sigma[r]) > range_.probability)) return false;
  }
  return true;
}

std::optional<double> DistanceTest::relative_probability(const Dimensions& d) const {
  double product = 1.0;
  const auto include = [&](double probability, double at_zero) {
    if (!(probability > range_.probability * at_zero)) return false;
    product *= probability / at_zero;
    return true;
  };
  for (int r = 0; r < d.translations; ++r) {
    const double sigma = range_.noise_scale * d.t_sigma[r], v = range_.translation[r];
    if (!include(probability_within(d.t_mean[r], sigma, v), probability_within(0.0, sigma, v)))
      return std::nullopt;
  }
  const double aligned = range_.test == RotationTest::view ? 1.0 : 0.0;
  for (int r = 0; r < d.rotations; ++r) {
    if (!include(rotation_probability(d.r_mean[r], d.r_sigma[r]),
                 rotation_probability(aligned, d.r_sigma[r])))
      return std::nullopt;
  }
  return product;
}

SensorRange DistanceTest::least_range(const Dimensions& d) const {
  SensorRange least = range_;
  least.translation = {};
  const double s = range_.probability, scale = range_.noise_scale;
  for (int r = 0; r < d.translations; ++r)
    least.translation[r] = range_within(d.t_mean[r], scale * d.t_sigma[r], s);
  least.rotation = 0.0;
  for (int r = 0; r < d.rotations; ++r) {
    const double sigma = scale * d.r_sigma[r];
    double v = 0.0;
    if (range_.test == RotationTest::view) {
      v = bisect(0.0, std::numbers::pi, s, [&](double angle) {
        return 1.0 - probability_below(std::cos(angle), d.r_mean[r], sigma);
      });
    } else {
      v = std::min(std::numbers::pi, range_within(d.r_mean[r], sigma, s));
    }
    least.rotation = std::max(least.rotation, v);
  }
  return least;
}

}  // namespace cairn::compact
