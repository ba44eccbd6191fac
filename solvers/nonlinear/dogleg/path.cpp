// SPDX-License-Identifier: BSD-3-Clause
#include "path.hpp"

#include <algorithm>
#include <cmath>

#include "descent.hpp"

namespace cairn {

void DoglegPath::prepare(const BlockMatrix& H, std::span<const double> g,
                         std::span<const double> diagonal, std::span<const double> min_diagonal) {
  for (std::size_t k = 0; k < D_.size(); ++k) {
    D_[k] = std::max(diagonal[k], min_diagonal[k]);
    cauchy_[k] = g[k] / D_[k];
  }
  H.multiply(cauchy_, product_);
  const double slope = dot(g, cauchy_), curvature = dot(cauchy_, product_);
  const double length = curvature > 0.0 ? slope / curvature : 0.0;
  for (double& c : cauchy_) c *= length;
  cauchy_slope_ = slope * length;
  newton_slope_ = dot(g, newton_);
  cauchy_length_ = norm(cauchy_);
  newton_length_ = norm(newton_);
}

double DoglegPath::norm(std::span<const double> v) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < v.size(); ++k) sum += D_[k] * v[k] * v[k];
  return std::sqrt(sum);
}

DoglegPath::Step DoglegPath::end(std::span<double> out) const { return combine(0.0, 1.0, out); }

DoglegPath::Step DoglegPath::at(double radius, std::span<double> out) const {
  if (newton_length_ <= radius) return end(out);
  if (cauchy_length_ >= radius) return combine(radius / cauchy_length_, 0.0, out);
  // ‖c + t (n − c)‖_D = radius, 0 < t < 1: t solves A t² + 2 B t − C = 0.
  double cn = 0.0;
  for (std::size_t k = 0; k < D_.size(); ++k) cn += D_[k] * cauchy_[k] * newton_[k];
  const double cc = cauchy_length_ * cauchy_length_, nn = newton_length_ * newton_length_;
  const double A = cc - 2.0 * cn + nn, B = cn - cc, C = radius * radius - cc;
  const double root = std::sqrt(std::max(0.0, B * B + A * C));
  const double t = std::clamp(B > 0.0 ? C / (B + root) : (root - B) / A, 0.0, 1.0);
  return combine(1.0 - t, t, out);
}

/// δ = a c + b n. With H n = g and cᵀHc = gᵀc the model's fall 2gᵀδ − δᵀHδ needs no further
/// product.
DoglegPath::Step DoglegPath::combine(double a, double b, std::span<double> out) const {
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = a * cauchy_[k] + b * newton_[k];
  const double gc = cauchy_slope_, gn = newton_slope_;
  return {norm(out), 2.0 * (a * gc + b * gn) - a * a * gc - 2.0 * a * b * gc - b * b * gn};
}

}  // namespace cairn
