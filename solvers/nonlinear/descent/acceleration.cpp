// SPDX-License-Identifier: BSD-3-Clause
#include "acceleration.hpp"

#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "descent.hpp"

namespace cairn {
namespace {

/// Little is less than this share of chi2.
constexpr double kLittle = 1e-2;
/// After so many steps in a row that gain little, pairs are remembered, and then used: where
/// Gauss-Newton converges fast, it has arrived by then.
constexpr int kRemember = 6, kUse = 8;
/// Pairs; there are few directions in which H is wrong.
constexpr std::size_t kMemory = 20;
/// A curvature below this share of what H has along a step is none.
constexpr double kLeastCurvature = 1e-8;

void add(double factor, std::span<const double> from, std::span<double> to) {
  for (std::size_t k = 0; k < to.size(); ++k) to[k] += factor * from[k];
}

}  // namespace

void Acceleration::follow(const Descent& run) {
  chi2_before_ = run.chi2;
  has_taken_ = std::exchange(takes_, false);
  begun_.reset();
  if (little_ + 1 < kRemember) return;
  begun_.emplace();
  if (pairs_.size() == kMemory) {  // whose room is used again
    *begun_ = std::move(pairs_.back());
    pairs_.pop_back();
  }
  const std::span<const double> g = run.equations().g();
  begun_->s = run.step;
  begun_->y.assign(g.begin(), g.end());
}

/// At the end of the last step, unless that has been seen already.
void Acceleration::look_back(const Descent& run) {
  if (!chi2_before_) return;
  const double before = *std::exchange(chi2_before_, std::nullopt);
  const bool may_help = !run.exact() && !run.gauge_is_left_free() && run.free().empty();
  little_ = may_help && before - run.chi2 <= kLittle * before ? little_ + 1 : 0;
  if (little_ == 0) pairs_.clear();
  if (!begun_ || little_ < kRemember) return;
  SecantPair pair = std::move(*begun_);
  begun_.reset();
  add(-1.0, run.equations().g(), pair.y);
  pair.curvature = dot(pair.s, pair.y);
  double least = 0.0;
  const std::span<const double> diagonal = run.equations().diagonal();
  for (std::size_t k = 0; k < pair.s.size(); ++k) least += diagonal[k] * pair.s[k] * pair.s[k];
  if (pair.curvature > kLeastCurvature * least) pairs_.push_front(std::move(pair));
}

bool Acceleration::may_end(const Descent& run) const {
  return !has_taken_ || run.is_small(decrement_);
}

void Acceleration::aim(Descent& run) {
  decrement_ = 0.0;
  takes_ = false;
  look_back(run);
  if (pairs_.empty() || little_ < kUse) return;
  const std::span<const double> g = run.equations().g();
  std::vector<double> q(g.begin(), g.end()), along;
  for (const SecantPair& pair : pairs_) {
    along.push_back(dot(pair.s, q) / pair.curvature);
    add(-along.back(), pair.y, q);
  }
  step_.resize(q.size());
  run.solve_for(q, step_);
  for (std::size_t i = pairs_.size(); i-- > 0;)
    add(along[i] - dot(pairs_[i].y, step_) / pairs_[i].curvature, pairs_[i].s, step_);
  const double decrement = dot(g, step_);
  if (decrement > 0.0 && std::isfinite(decrement)) decrement_ = decrement;
}

std::optional<double> Acceleration::take(Descent& run) {
  if (decrement_ == 0.0) return std::nullopt;
  run.equations().retract(run.estimate, step_, run.trial);
  const double chi2 = run.equations().chi2(run.trial);
  if (!(chi2 < run.chi2)) return std::nullopt;
  run.step.swap(step_);
  takes_ = true;
  return chi2;
}

}  // namespace cairn
