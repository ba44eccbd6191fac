// SPDX-License-Identifier: BSD-3-Clause
#include "path_closure.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

namespace cairn {
namespace {

using Eigen::Matrix3d;

/// Ratios that are multiplied before the logarithm is taken: even 10⁻¹² each does not underflow.
constexpr std::size_t kRatiosPerLogarithm = 16;

double sum_of_logarithms(std::span<const double> ratios) {
  double sum = 0.0;
  for (std::size_t i = 0; i < ratios.size(); i += kRatiosPerLogarithm) {
    const std::size_t end = std::min(i + kRatiosPerLogarithm, ratios.size());
    double product = 1.0;
    for (std::size_t k = i; k < end; ++k) product *= ratios[k];
    sum += std::log(product);
  }
  return sum;
}

}  // namespace

std::vector<const PathClosure*> in_order(const PathClosure* last) {
  std::vector<const PathClosure*> closures(last ? static_cast<std::size_t>(last->count) : 0);
  for (std::size_t k = closures.size(); k-- > 0; last = last->before.get()) closures[k] = last;
  return closures;
}

MarginalUpdates::MarginalUpdates(PoseCovariances& covariances, double memory, int most_poses,
                                 ClosureEffect PathClosure::*effect)
    : covariances_(covariances),
      effect_(effect),
      kernel_(choose_marginal_kernel()),
      every_(1 + (covariances.size() - 1) / most_poses),
      count_(static_cast<std::size_t>((covariances.size() + every_ - 1) / every_)),
      padded_((count_ + PoseCovariances::kLanes - 1) / PoseCovariances::kLanes *
              PoseCovariances::kLanes),
      last_weight_(covariances.size() - every_ * (static_cast<int>(count_) - 1)),
      columns_(is_of_all() ? 0 : static_cast<std::size_t>(covariances.size())) {
  const std::size_t padded = padded_;
  diagonal_.assign(6 * padded, 0.0);
  inverse_determinants_.assign(padded, 1.0);
  ratios_.assign(padded, 1.0);
  for (std::size_t i = 0; i < padded; ++i) {
    // A pose without uncertainty counts as one with |Σ_ii| = 1, before and after.
    Matrix3d D = Matrix3d::Identity();
    if (i < count_) {
      const Matrix3d now = covariances.diagonal(pose(i)) + covariances.prior();
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

const double* MarginalUpdates::column(int a) {
  if (is_of_all()) return covariances_.column(a);
  std::vector<double>& column = columns_[static_cast<std::size_t>(a)];
  if (!column.empty()) return column.data();
  const double* all = covariances_.column(a);
  column.assign(9 * padded_, 0.0);
  for (std::size_t entry = 0; entry < 9; ++entry, all += covariances_.padded()) {
    for (std::size_t i = 0; i < count_; ++i) column[entry * padded_ + i] = all[pose(i)];
  }
  return column.data();
}

double MarginalUpdates::change(const PathClosure& closure) {
  if (!(closure.*effect_).change) update(in_order(&closure));
  return *(closure.*effect_).change;
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
  fresh->Z.resize(9 * padded_);
  fresh->diagonal.resize(6 * padded_);
  kept_.push_back(fresh);
  return fresh;
}

void MarginalUpdates::update(std::span<const PathClosure* const> closures) {
  std::vector<std::shared_ptr<const UpdatedMarginals>> after;  // each of the closures
  for (const PathClosure* closure : closures) after.push_back((closure->*effect_).marginals.lock());
  after.back() = nullptr;
  std::vector<const double*> Z(closures.size());
  std::vector<MarginalUpdate> updates;
  for (std::size_t k = 0; k < closures.size(); ++k) {
    const PathClosure& closure = *closures[k];
    if (!after[k]) {
      const std::shared_ptr<UpdatedMarginals> updated = unused();
      updates.push_back(
          {.padded = static_cast<int>(padded_),
           .newest = column(covariances_.size() - 1),
           .other = column(closure.pose),
           .closures = static_cast<int>(k),
           .Z_before = Z.data(),
           .coupling = closure.coupling.empty() ? nullptr : closure.coupling.front().data(),
           .inverse = closure.inverse.data(),
           .diagonal = k == 0 ? diagonal_.data() : after[k - 1]->diagonal.data(),
           .determinants = inverse_determinants_.data(),
           .Z = updated->Z.data(),
           .updated = updated->diagonal.data(),
           .ratios = k + 1 == closures.size() ? ratios_.data() : nullptr});
      (closure.*effect_).marginals = updated;
      after[k] = updated;
    }
    Z[k] = after[k]->Z.data();
  }
  kernel_(updates.data(), static_cast<int>(updates.size()));
  const std::span<const double> ratios(ratios_);
  (closures.back()->*effect_).change = every_ * sum_of_logarithms(ratios.first(count_ - 1)) +
                                       last_weight_ * std::log(ratios[count_ - 1]);
}

void MarginalUpdates::whiten(std::span<const PathClosure* const> closures, int pose,
                             std::vector<Matrix3d>& Z) {
  Z.resize(closures.size());
  const int newest = covariances_.size() - 1;
  for (std::size_t c = 0; c < closures.size(); ++c) {
    const PathClosure& closure = *closures[c];
    if (const auto kept = (closure.*effect_).marginals.lock()) {
      const double* entries = kept->Z.data() + pose;
      for (std::ptrdiff_t entry = 0; entry < 9; ++entry)
        Z[c].data()[entry] = entries[entry * covariances_.padded()];
      continue;
    }
    if (const auto known = closure.pose_Z.find(pose); known != closure.pose_Z.end()) {
      Z[c] = known->second;
      continue;
    }
    Matrix3d y =
        (covariances_.block(pose, newest) - covariances_.block(pose, closure.pose)).transpose();
    for (std::size_t b = 0; b < c; ++b) y.noalias() -= closure.coupling[b] * Z[b];
    Z[c].noalias() = closure.inverse * y;
    closure.pose_Z.emplace(pose, Z[c]);
  }
}

}  // namespace cairn
