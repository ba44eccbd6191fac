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

void update_stretches(std::span<const PathClosure* const> before, const Matrix3d& innovation,
                      const Matrix3d& start, const Matrix3d& start_posterior,
                      PathClosure& closure) {
  constexpr std::size_t kStretches = StretchUpdate::kStretches;
  static const UpdateStretches kernel = choose_stretch_kernel();
  const std::size_t count = before.size() + 1, blocks = (count + kStretches - 1) / kStretches;
  const auto at = [](std::size_t entries, std::size_t stretch, std::size_t entry) {
    return (stretch / kStretches * entries + entry) * kStretches + stretch % kStretches;
  };
  std::vector<double> innovations(9 * kStretches * blocks, 0.0), ends;
  std::vector<const double*> Z_before;
  for (std::size_t i = 0; i < count; ++i) {
    const Matrix3d y = innovation + (i == 0 ? start : before[i - 1]->walk);
    for (std::size_t e = 0; e < 9; ++e) innovations[at(9, i, e)] = y.data()[e];
  }
  for (const PathClosure* b : before) {
    Z_before.push_back(b->stretch_Z.data());
    ends.insert(ends.end(), b->end.data(), b->end.data() + 9);
  }
  closure.stretch_Z.resize(18 * kStretches * blocks);
  if (!before.empty()) closure.stretch_marginals = before.back()->stretch_marginals;
  closure.stretch_marginals.resize(21 * kStretches * blocks, 0.0);
  const Matrix3d& newest = before.empty() ? start_posterior : before.back()->posterior;
  std::size_t entry = 0;
  for (int c = 0; c < 3; ++c) {
    for (int r = c; r < 3; ++r)
      closure.stretch_marginals[at(21, count - 1, entry++)] = newest(r, c);
  }
  kernel({.closures = static_cast<int>(before.size()),
          .Z_before = Z_before.data(),
          .ends = ends.data(),
          .coupling = closure.coupling.empty() ? nullptr : closure.coupling.front().data(),
          .inverse = closure.inverse.data(),
          .innovation = innovations.data(),
          .Z = closure.stretch_Z.data(),
          .marginals = closure.stretch_marginals.data()});
  // As they will be of the stretches that are still to come; their marginals are not begun.
  for (std::size_t i = count; i < kStretches * blocks; ++i) {
    for (std::size_t e = 0; e < 9; ++e) {
      closure.stretch_Z[at(18, i, e)] = closure.end.data()[e];
      closure.stretch_Z[at(18, i, 9 + e)] = 0.0;
    }
    for (std::size_t e = 0; e < 21; ++e) closure.stretch_marginals[at(21, i, e)] = 0.0;
  }
}

StretchMarginals::StretchMarginals(const PathClosure& closure, int stretch) {
  constexpr std::size_t kStretches = StretchUpdate::kStretches;
  const auto i = static_cast<std::size_t>(stretch);
  const double* entries =
      closure.stretch_marginals.data() + i / kStretches * 21 * kStretches + i % kStretches;
  const auto next = [&] { return *std::exchange(entries, entries + kStretches); };
  for (int c = 0; c < 3; ++c) {
    for (int r = c; r < 3; ++r) posterior(r, c) = posterior(c, r) = next();
  }
  for (double& entry : Q.reshaped()) entry = next();
  for (int c = 0; c < 3; ++c) {
    for (int r = c; r < 3; ++r) T(r, c) = T(c, r) = next();
  }
}

Matrix3d StretchMarginals::after(const Matrix3d& D) const {
  Matrix3d half = Q;
  half.noalias() += 0.5 * T * D;
  const Matrix3d less = D * half;
  return posterior + D - less - less.transpose();
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

}  // namespace cairn
