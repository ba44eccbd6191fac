// SPDX-License-Identifier: BSD-3-Clause
#include "path_closure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/LU>

namespace cairn {
namespace {

using Eigen::Matrix3d;

constexpr int kLanes = PoseCovariances::kLanes;
/// Numbers of as many poses: arithmetic on them is that of vector instructions.
using Lanes = Eigen::Array<double, kLanes, 1>;
using View = Eigen::Map<const Lanes>;

/// Ratios that are multiplied before the logarithm is taken: even 10⁻¹² each does not underflow.
constexpr int kRatiosPerLogarithm = 8;

/// Of symmetric 3×3 matrices by the entries of their lower triangles, column by column.
Lanes determinant(const std::array<Lanes, 6>& D) {
  return D[0] * (D[3] * D[5] - D[4] * D[4]) - D[1] * (D[1] * D[5] - D[4] * D[2]) +
         D[2] * (D[1] * D[4] - D[3] * D[2]);
}

/// What one update of all poses reads and writes.
struct Update {
  const double *newest, *other;                   ///< columns of x_t and x_l
  const double *diagonal, *inverse_determinants;  ///< before
  std::span<const std::shared_ptr<const UpdatedMarginals>> before;
  const PathClosure* closure;
  double *Z, *out;
};

/// Z_i = L⁻¹ (cov(y, ε_i) − Σ_b L_b Z_b,i) of eight poses, one column (a coordinate of ε_i) at a
/// time, and Σ'_ii = Σ_ii − Z_iᵀ Z_i; returns |Σ'_ii| / |Σ_ii now|.
Lanes update_lanes(const Update& u, std::ptrdiff_t padded, std::ptrdiff_t at) {
  const Matrix3d& inverse = u.closure->inverse;
  std::array<Lanes, 9> Z;
  for (int r = 0; r < 3; ++r) {
    std::array<Lanes, 3> y;
    for (int c = 0; c < 3; ++c) {  // cov(ε_i, y) = Σ_it − Σ_il
      const std::ptrdiff_t entry = (3 * c + r) * padded + at;
      y[c] = View(u.newest + entry) - View(u.other + entry);
    }
    for (std::size_t b = 0; b < u.before.size(); ++b) {
      const Matrix3d& L = u.closure->coupling[b];
      const double* Z_b = u.before[b]->Z.data() + 3 * r * padded + at;
      const Lanes z0 = View(Z_b), z1 = View(Z_b + padded), z2 = View(Z_b + 2 * padded);
      for (int c = 0; c < 3; ++c) y[c] -= L(c, 0) * z0 + L(c, 1) * z1 + L(c, 2) * z2;
    }
    Z[3 * r] = inverse(0, 0) * y[0];
    Z[3 * r + 1] = inverse(1, 0) * y[0] + inverse(1, 1) * y[1];
    Z[3 * r + 2] = inverse(2, 0) * y[0] + inverse(2, 1) * y[1] + inverse(2, 2) * y[2];
    for (int c = 0; c < 3; ++c) Eigen::Map<Lanes>(u.Z + (3 * r + c) * padded + at) = Z[3 * r + c];
  }
  std::array<Lanes, 6> D;
  int entry = 0;
  for (int c = 0; c < 3; ++c) {
    for (int r = c; r < 3; ++r, ++entry) {
      D[entry] = View(u.diagonal + entry * padded + at) - Z[3 * r] * Z[3 * c] -
                 Z[3 * r + 1] * Z[3 * c + 1] - Z[3 * r + 2] * Z[3 * c + 2];
      Eigen::Map<Lanes>(u.out + entry * padded + at) = D[entry];
    }
  }
  return determinant(D) * View(u.inverse_determinants + at);
}

}  // namespace

std::vector<const PathClosure*> in_order(const PathClosure* last) {
  std::vector<const PathClosure*> closures(last ? static_cast<std::size_t>(last->count) : 0);
  for (std::size_t k = closures.size(); k-- > 0; last = last->before.get()) closures[k] = last;
  return closures;
}

MarginalUpdates::MarginalUpdates(PoseCovariances& covariances, double memory)
    : covariances_(covariances) {
  const auto padded = static_cast<std::size_t>(covariances.padded());
  diagonal_.assign(6 * padded, 0.0);
  inverse_determinants_.assign(padded, 1.0);
  for (std::size_t i = 0; i < padded; ++i) {
    // A pose without uncertainty counts as one with |Σ_ii| = 1, before and after.
    Matrix3d D = Matrix3d::Identity();
    if (i < static_cast<std::size_t>(covariances.size())) {
      const Matrix3d now = covariances.diagonal(static_cast<int>(i)) + covariances.prior();
      if (now.determinant() > 0.0) D = now;
    }
    std::size_t entry = 0;
    for (int c = 0; c < 3; ++c) {
      for (int r = c; r < 3; ++r) diagonal_[padded * entry++ + i] = D(r, c);
    }
    inverse_determinants_[i] = 1.0 / D.determinant();
    sum_ += std::log(D.determinant());
  }
  const double each = 15.0 * sizeof(double) * static_cast<double>(padded);
  most_kept_ = static_cast<std::size_t>(memory / each) + 1;
}

double MarginalUpdates::change(const PathClosure& closure) {
  double change = 0.0;
  marginals(in_order(&closure), &change);
  return change;
}

std::shared_ptr<UpdatedMarginals> MarginalUpdates::unused() {
  std::shared_ptr<UpdatedMarginals> free;
  if (kept_.size() >= most_kept_) {
    // Its memory, unless an update reads it at present.
    if (kept_.front().use_count() == 1) free = std::move(kept_.front());
    kept_.pop_front();
  }
  // A new control block: the closure whose marginals these were must not find them again.
  auto fresh = std::make_shared<UpdatedMarginals>();
  if (free) std::swap(*fresh, *free);
  const auto padded = static_cast<std::size_t>(covariances_.padded());
  fresh->Z.resize(9 * padded);
  fresh->diagonal.resize(6 * padded);
  kept_.push_back(fresh);
  return fresh;
}

MarginalUpdates::Marginals MarginalUpdates::marginals(std::span<const PathClosure* const> closures,
                                                      double* change) {
  const PathClosure& last = *closures.back();
  if (!change) {
    if (Marginals kept = last.marginals.lock()) return kept;
  }
  std::vector<Marginals> before;
  for (std::size_t b = 1; b < closures.size(); ++b)
    before.push_back(marginals(closures.first(b), nullptr));
  const std::shared_ptr<UpdatedMarginals> updated = unused();
  const Update update{
      .newest = covariances_.column(covariances_.size() - 1),
      .other = covariances_.column(last.pose),
      .diagonal = before.empty() ? diagonal_.data() : before.back()->diagonal.data(),
      .inverse_determinants = inverse_determinants_.data(),
      .before = before,
      .closure = &last,
      .Z = updated->Z.data(),
      .out = updated->diagonal.data()};
  double sum = 0.0;
  Lanes product = Lanes::Ones();
  for (int at = 0, count = 1; at < covariances_.padded(); at += kLanes, ++count) {
    product *= update_lanes(update, covariances_.padded(), at);
    if (count % kRatiosPerLogarithm != 0 && at + kLanes < covariances_.padded()) continue;
    sum += product.log().sum();
    product.setOnes();
  }
  if (change) *change = sum;
  last.marginals = updated;
  return updated;
}

void MarginalUpdates::whiten(std::span<const PathClosure* const> closures, int pose,
                             std::vector<Matrix3d>& Z) {
  Z.resize(closures.size());
  const int newest = covariances_.size() - 1;
  for (std::size_t c = 0; c < closures.size(); ++c) {
    const PathClosure& closure = *closures[c];
    if (const Marginals kept = closure.marginals.lock()) {
      const double* entries = kept->Z.data() + pose;
      for (std::ptrdiff_t entry = 0; entry < 9; ++entry)
        Z[c].data()[entry] = entries[entry * covariances_.padded()];
      continue;
    }
    Matrix3d y =
        (covariances_.block(pose, newest) - covariances_.block(pose, closure.pose)).transpose();
    for (std::size_t b = 0; b < c; ++b) y -= closure.coupling[b] * Z[b];
    Z[c] = closure.inverse * y;
  }
}

}  // namespace cairn
