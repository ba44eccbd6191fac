// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include "cairn/runtime/error.hpp"
#include "dense/lu.hpp"
#include "recovery.hpp"

namespace cairn::sparsify {
namespace {

/// All W_k as one vector, whole matrices, so that its norm is that of Frobenius.
class Stack {
 public:
  explicit Stack(const ScaledProblem& problem) {
    for (int k = 0; k < problem.factors(); ++k) {
      sizes_.push_back(problem.size(k));
      size_ += problem.size(k) * problem.size(k);
    }
  }
  int size() const { return size_; }
  Vector pack(const std::vector<Matrix>& all) const {
    Vector x(size_);
    Eigen::Index at = 0;
    for (const Matrix& A : all) {
      x.segment(at, A.size()) = Eigen::Map<const Vector>(A.data(), A.size());
      at += A.size();
    }
    return x;
  }
  std::vector<Matrix> unpack(const Vector& x) const {
    std::vector<Matrix> all;
    Eigen::Index at = 0;
    for (const int m : sizes_) {
      all.emplace_back(Eigen::Map<const Matrix>(x.data() + at, m, m));
      at += m * m;
    }
    return all;
  }
  Vector projected(const Vector& x) const {
    std::vector<Matrix> all = unpack(x);
    for (Matrix& A : all) A = nearest_positive(A);
    return pack(all);
  }

 private:
  std::vector<int> sizes_;
  int size_ = 0;
};

/// B of limited-memory BFGS in compact form, B = σI − N M⁻¹ Nᵀ (Byrd, Nocedal and Schnabel 1994).
class Model {
 public:
  explicit Model(int memory) : memory_(memory) {}
  void add(const Vector& s, const Vector& y) {
    if (!(s.dot(y) > 1e-12 * s.norm() * y.norm())) return;
    s_.push_back(s);
    y_.push_back(y);
    if (static_cast<int>(s_.size()) > memory_) {
      s_.pop_front();
      y_.pop_front();
    }
    const auto n = static_cast<Eigen::Index>(s_.size());
    sigma_ = y.squaredNorm() / s.dot(y);
    N_.resize(s.size(), 2 * n);
    Matrix M = Matrix::Zero(2 * n, 2 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      N_.col(i) = sigma_ * s_[i];
      N_.col(n + i) = y_[i];
      for (Eigen::Index j = 0; j < n; ++j) {
        M(i, j) = sigma_ * s_[i].dot(s_[j]);
        if (i > j) M(i, n + j) = M(n + j, i) = s_[i].dot(y_[j]);
      }
      M(n + i, n + i) = -s_[i].dot(y_[i]);
    }
    inverse_ = M.inverse();
  }
  Vector times(const Vector& x) const {
    if (s_.empty()) return sigma_ * x;
    return sigma_ * x - N_ * (inverse_ * (N_.transpose() * x));
  }
  void scale(double sigma) { sigma_ = sigma; }
  double sigma() const { return sigma_; }

 private:
  int memory_;
  std::deque<Vector> s_, y_;
  double sigma_ = 1.0;
  Matrix N_, inverse_;
};

/// Minimises gᵀ(z − x) + ½ (z − x)ᵀB(z − x) over z ⪰ 0 by spectral projected gradients.
Vector minimize(const Model& model, const Stack& stack, const Vector& x, const Vector& g) {
  Vector z = x, slope = g;
  double length = 1.0 / std::max(model.sigma(), 1e-12);
  for (int k = 0; k < 20; ++k) {
    const Vector direction = stack.projected(z - length * slope) - z;
    const Vector curved = model.times(direction);
    const double descent = slope.dot(direction), curvature = direction.dot(curved);
    if (!(descent < -1e-14)) break;
    const double t = curvature > 0.0 ? std::min(1.0, -descent / curvature) : 1.0;
    z += t * direction;
    slope += t * curved;
    length = curvature > 0.0 ? std::clamp(direction.squaredNorm() / curvature, 1e-8, 1e8) : 1.0;
  }
  return z;
}

}  // namespace

RecoveryResult ProjectedQuasiNewton::recover(const RecoveryProblem& problem) {
  refuse_background(problem, "pqn");
  RecoveryClock clock(options_, trace_);
  const ScaledProblem scaled(problem);
  Approximation at(scaled);
  begin(problem, options_.initial, at);
  const Stack stack(scaled);
  Model model(memory_);
  const auto gradient = [&] {
    std::vector<Matrix> all;
    for (int k = 0; k < scaled.factors(); ++k)
      all.push_back(0.5 * (Matrix::Identity(scaled.size(k), scaled.size(k)) - at.M(k)));
    return stack.pack(all);
  };
  clock.record(at.kld());
  Vector x = stack.pack(at.W()), g = gradient();
  model.scale(std::max(1.0, g.norm()));
  int iterations = 0;
  bool converged = at.gradient() <= options_.tolerance;
  while (!converged && iterations < options_.iterations && has_time(clock)) {
    ++iterations;
    const Vector direction = minimize(model, stack, x, g) - x;
    const double slope = g.dot(direction), cost = at.kld();
    const std::vector<Matrix> before = at.W();
    bool moved = false;
    for (double t = 1.0; t > 1e-12 && slope < 0.0; t *= 0.5) {
      if (at.set(stack.unpack(x + t * direction)) && at.kld() <= cost + 1e-4 * t * slope) {
        moved = true;
        break;
      }
    }
    if (!moved) {  // rounding is all that is left
      at.set(before);
      break;
    }
    const Vector there = stack.pack(at.W()), slope_there = gradient();
    model.add(there - x, slope_there - g);
    x = there;
    g = slope_there;
    clock.record(at.kld());
    converged = at.gradient() <= options_.tolerance;
  }
  return clock.finish(at, iterations, converged);
}

}  // namespace cairn::sparsify
