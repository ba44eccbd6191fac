// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "cairn/runtime/error.hpp"
#include "conservative.hpp"
#include "dense/cholesky.hpp"
#include "dense/products.hpp"
#include "recovery.hpp"

namespace cairn::sparsify {
namespace {

/// S is changed by small steps so often before it is computed anew.
constexpr int kFresh = 200;
/// A gain of less is rounding [nats].
constexpr double kRounding = 1e-14;

/// Whether nobody else measures what factor k does: M_k⁻¹ = W_k (proposition 3).
bool alone(const Approximation& at, int k) {
  const Eigen::Index m = at.W(k).rows();
  return (dense::product(at.W(k), at.M(k)) - Matrix::Identity(m, m)).cwiseAbs().maxCoeff() < 1e-9;
}

/// Symmetric, and positive definite in spite of rounding: where some directions are known a
/// billion times better than others, the least eigenvalues are lost in it.
Matrix positive(const Matrix& A) {
  Matrix B = 0.5 * (A + A.transpose());
  for (double part = 1e-15; Eigen::LLT<Matrix>(B).info() != Eigen::Success; part *= 10.0)
    B.diagonal() += part * B.diagonal().cwiseAbs() + Vector::Constant(B.rows(), 1e-300);
  return B;
}

class Descent {
 public:
  /// `has_time`: asked before each step.
  Descent(Approximation& at, const RecoveryOptions& options, RecoveryClock& clock,
          const std::function<bool()>& has_time)
      : at_(at),
        options_(options),
        clock_(clock),
        has_time_(has_time),
        // A step that changes W by E gains about ¼ ‖E‖².
        least_(std::max(0.25 * options.tolerance * options.tolerance, kRounding)) {
    for (int k = 0; k < at.problem().factors(); ++k) {
      if (alone(at, k)) {
        const Eigen::Index m = at.W(k).rows();
        at.change(k, Matrix::Identity(m, m));
      } else {
        left_.push_back(k);
      }
    }
    refresh();
  }

  bool converged() const { return converged_; }
  int iterations() const { return iterations_; }

  void cycle() {
    while (go_on()) {
      double most = 0.0;
      for (const int k : left_) {
        if (!go_on()) return;
        const Approximation::Best best = at_.best(k);
        most = std::max(most, best.gain);
        if (best.gain > 0.0) step(k, best.W);
      }
      if (most <= least_ && settled()) return;
    }
  }

  /// Bounds first: only for a factor that might gain the most is the gain itself computed.
  void greedy() {
    std::vector<double> bounds(left_.size());
    while (go_on()) {
      for (std::size_t i = 0; i < left_.size(); ++i) bounds[i] = at_.bound(left_[i]);
      Approximation::Best best;
      std::size_t chosen = left_.size();
      while (true) {
        const auto top = std::max_element(bounds.begin(), bounds.end());
        if (top == bounds.end() || *top <= std::max(best.gain, least_)) break;
        const auto i = static_cast<std::size_t>(top - bounds.begin());
        Approximation::Best tried = at_.best(left_[i]);
        bounds[i] = -1.0;
        if (tried.gain > best.gain) {
          best = std::move(tried);
          chosen = i;
        }
      }
      if (chosen == left_.size() || best.gain <= least_) {
        if (settled()) return;
        continue;
      }
      step(left_[chosen], best.W);
    }
  }

 private:
  bool go_on() {
    if (left_.empty()) converged_ = true;
    return !converged_ && iterations_ < options_.iterations && has_time_();
  }
  void step(int k, const Matrix& W) {
    at_.change(k, W);
    ++iterations_;
    if (++since_ >= kFresh) refresh();
    clock_.record(at_.kld());
  }
  void refresh() {
    since_ = 0;
    if (!at_.refresh())
      throw Error(ErrorCode::numerical, "factor descent: the approximation became singular");
  }
  /// Without the rounding of many small steps, the gradient is as small as asked for; if not, less
  /// is taken for nothing from now on.
  bool settled() {
    if (since_ > 0) refresh();
    converged_ = at_.gradient() <= options_.tolerance || least_ <= kRounding;
    least_ = std::max(0.1 * least_, kRounding);
    return converged_;
  }

  Approximation& at_;
  const RecoveryOptions& options_;
  RecoveryClock& clock_;
  const std::function<bool()>& has_time_;
  double least_;
  std::vector<int> left_;
  int iterations_ = 0, since_ = 0;
  bool converged_ = false;
};

}  // namespace

RecoveryResult RecoveryClock::finish(const Approximation& at, int iterations, bool converged) {
  RecoveryResult result;
  result.seconds = seconds();
  result.kld = at.kld();
  result.gradient = at.gradient();
  result.iterations = iterations;
  result.converged = converged;
  result.trace = std::move(points_);
  for (int k = 0; k < at.problem().factors(); ++k) {
    const Matrix information = positive(at.problem().information(k, at.W(k)));
    result.information.emplace_back(information.data(), information.data() + information.size());
  }
  return result;
}

RecoveryResult ClosedForm::recover(const RecoveryProblem& problem) {
  refuse_background(problem, "closed_form");
  RecoveryClock clock({}, false);
  const ScaledProblem scaled(problem);
  Approximation at(scaled);
  std::vector<Matrix> W;
  int rows = 0;
  for (int k = 0; k < scaled.factors(); ++k) {
    W.push_back(Matrix::Identity(scaled.size(k), scaled.size(k)));
    rows += scaled.size(k);
  }
  if (rows != problem.rank || !at.set(std::move(W))) {
    throw Error(ErrorCode::usage,
                "closed_form solves topologies whose factors are independent, such as trees "
                "(topology clt or cliquey); take ncfd or fd for others");
  }
  return clock.finish(at, 0, true);
}

RecoveryResult FactorDescent::recover(const RecoveryProblem& problem) {
  if (conservative_) refuse_background(problem, "conservative=true");
  RecoveryClock clock(options_, trace_);
  const ScaledProblem scaled(problem);
  Approximation at(scaled);
  begin(problem, options_.initial, at);
  clock.record(at.kld());
  const std::function<bool()> has_time = [&] { return this->has_time(clock); };
  Descent descent(at, options_, clock, has_time);
  if (greedy_) {
    descent.greedy();
  } else {
    descent.cycle();
  }
  if (conservative_) make_conservative(at);
  return clock.finish(at, descent.iterations(), descent.converged());
}

}  // namespace cairn::sparsify
