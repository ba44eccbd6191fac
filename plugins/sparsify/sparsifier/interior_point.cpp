// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"
#include "recovery.hpp"

namespace cairn::sparsify {
namespace {

/// Least eigenvalue of a W to begin with, in units in which its optimum alone is 1. From nearer to
/// the boundary the barrier, whose weight is in proportion to its gradient, would begin too light
/// to lead away from it.
constexpr double kInside = 0.1;
/// The barrier's weight and the Newton decrement are not asked to be smaller than this.
constexpr double kRounding = 1e-14;
/// A step goes this far of the way to where a W becomes singular, at most.
constexpr double kToBoundary = 0.95;

/// The upper triangles of all W_k, one after the other, as one vector.
class Packing {
 public:
  explicit Packing(const ScaledProblem& problem) {
    for (int k = 0; k < problem.factors(); ++k) {
      begin_.push_back(size_);
      const int m = problem.size(k);
      size_ += static_cast<int>(packed_size(m));
    }
  }
  int size() const { return size_; }
  int begin(int k) const { return begin_[k]; }

  /// tr(E_i A) of each unit matrix E_i, which has two ones off the diagonal.
  static void traces(const Matrix& A, double* out) {
    for (Eigen::Index a = 0; a < A.rows(); ++a) {
      for (Eigen::Index b = a; b < A.rows(); ++b) *out++ = a == b ? A(a, a) : A(a, b) + A(b, a);
    }
  }
  static Matrix unpack(const double* x, Eigen::Index m) {
    Matrix A(m, m);
    cairn::unpack(x, A);
    return A;
  }

 private:
  std::vector<int> begin_;
  int size_ = 0;
};

/// Adds factor · tr(E_i G E_j Gᵀ) for all i of the rows' factor and j of the columns'.
void add_hessian(const Matrix& G, double factor, Eigen::Ref<Matrix> H) {
  Eigen::Index i = 0;
  for (Eigen::Index a = 0; a < G.rows(); ++a) {
    for (Eigen::Index b = a; b < G.rows(); ++b, ++i) {
      const double row = a == b ? 0.5 : 1.0;
      Eigen::Index j = 0;
      for (Eigen::Index c = 0; c < G.cols(); ++c) {
        for (Eigen::Index d = c; d < G.cols(); ++d, ++j) {
          const double column = c == d ? 0.5 : 1.0;
          H(i, j) += 2.0 * factor * row * column * (G(a, c) * G(b, d) + G(a, d) * G(b, c));
        }
      }
    }
  }
}

/// The cost 2 KLD − ρ (Σ ln |W_k| [+ ln |I − Λ̆|]) and its derivatives, by V_k with
/// W_k + C_k V_k C_kᵀ, W_k = C_k C_kᵀ: the barrier's Hessian is ρ times the identity there. By W_k
/// itself it is ρ W_k⁻¹ ⊗ W_k⁻¹, which where a W_k becomes singular is so large that in the sum
/// nothing is left of the KLD's.
class Barrier {
 public:
  Barrier(const ScaledProblem& problem, bool conservative)
      : problem_(problem), packing_(problem), conservative_(conservative) {}

  int size() const { return packing_.size(); }
  /// Goes to W; false if it is not inside.
  bool go(const std::vector<Matrix>& W) {
    Matrix L = Matrix::Zero(problem_.rank, problem_.rank);
    double trace = 0.0, barrier = 0.0;
    std::vector<Matrix> C;
    for (int k = 0; k < problem_.factors(); ++k) {
      const Eigen::LLT<Matrix> llt(W[k]);
      if (llt.info() != Eigen::Success) return false;
      barrier += 2.0 * llt.matrixLLT().diagonal().array().log().sum();
      dense::add_product_of_transpose(problem_.Q[k], dense::product(W[k], problem_.Q[k]), L);
      trace += W[k].trace();
      C.emplace_back(llt.matrixL());
    }
    const Eigen::LLT<Matrix> llt(L);
    if (llt.info() != Eigen::Success) return false;
    if (conservative_) {
      const Matrix I = Matrix::Identity(L.rows(), L.rows());
      const Eigen::LLT<Matrix> rest(Matrix(I - L));
      if (rest.info() != Eigen::Success) return false;
      barrier += 2.0 * rest.matrixLLT().diagonal().array().log().sum();
      T_ = rest.solve(I);
    }
    cost_ = trace - 2.0 * llt.matrixLLT().diagonal().array().log().sum();
    barrier_ = barrier;
    S_ = llt.solve(Matrix::Identity(L.rows(), L.rows()));
    W_ = W;
    C_ = std::move(C);
    return true;
  }
  double cost(double rho) const { return cost_ - rho * barrier_; }
  const std::vector<Matrix>& W() const { return W_; }

  /// ‖∇KLD‖ / ‖∇barrier‖, by W.
  double balance() const {
    double kld = 0.0, barrier = 0.0;
    for (int k = 0; k < problem_.factors(); ++k) {
      Matrix B = -W_[k].inverse();
      if (conservative_) B += seen(k, T_);
      kld += slope_of(k).squaredNorm();
      barrier += B.squaredNorm();
    }
    return std::sqrt(kld / std::max(barrier, 1e-300));
  }

  Vector slope(double rho) const {
    Vector g(size());
    for (int k = 0; k < problem_.factors(); ++k) {
      Matrix A = slope_of(k);
      if (conservative_) A += rho * seen(k, T_);
      A = dense::congruent_of_transpose(C_[k], A);
      A.diagonal().array() -= rho;
      packing_.traces(A, g.data() + packing_.begin(k));
    }
    return g;
  }

  Matrix hessian(double rho) const {
    Matrix H = Matrix::Zero(size(), size());
    std::vector<Matrix> CQ;
    for (int k = 0; k < problem_.factors(); ++k)
      CQ.push_back(dense::product_of_transpose(C_[k], problem_.Q[k]));
    for (int k = 0; k < problem_.factors(); ++k) {
      const Matrix QS = dense::product(CQ[k], S_);
      const Matrix QT = conservative_ ? dense::product(CQ[k], T_) : Matrix();
      const int m = problem_.size(k), rows = m * (m + 1) / 2;
      for (int l = 0; l <= k; ++l) {
        const int n = problem_.size(l), columns = n * (n + 1) / 2;
        auto block = H.block(packing_.begin(k), packing_.begin(l), rows, columns);
        add_hessian(dense::product_with_transpose(QS, CQ[l]), 1.0, block);
        if (conservative_) add_hessian(dense::product_with_transpose(QT, CQ[l]), rho, block);
        if (l == k) add_hessian(Matrix::Identity(m, m), rho, block);
      }
    }
    return H.selfadjointView<Eigen::Lower>();
  }

  /// How much of a step may be taken, at most 1: W = C (I + t V) Cᵀ stays positive definite.
  double longest(const Vector& step) const {
    double least = 0.0;
    for (int k = 0; k < problem_.factors(); ++k) {
      const Matrix V = Packing::unpack(step.data() + packing_.begin(k), problem_.size(k));
      const Eigen::SelfAdjointEigenSolver<Matrix> eigen(V, Eigen::EigenvaluesOnly);
      least = std::min(least, eigen.eigenvalues()[0]);
    }
    return least < -kToBoundary ? -kToBoundary / least : 1.0;
  }
  std::vector<Matrix> moved(const Vector& step, double t) const {
    std::vector<Matrix> W = W_;
    for (int k = 0; k < problem_.factors(); ++k) {
      const Matrix V = Packing::unpack(step.data() + packing_.begin(k), problem_.size(k));
      const Matrix change = dense::congruent(C_[k], V);
      W[k] += 0.5 * t * (change + change.transpose());
    }
    return W;
  }

 private:
  /// Q A Qᵀ
  Matrix seen(int k, const Matrix& A) const { return dense::congruent(problem_.Q[k], A); }
  /// Of 2 KLD, by W_k.
  Matrix slope_of(int k) const {
    return Matrix::Identity(problem_.size(k), problem_.size(k)) - seen(k, S_);
  }

  const ScaledProblem& problem_;
  Packing packing_;
  bool conservative_;
  std::vector<Matrix> W_, C_;
  Matrix S_, T_;
  double cost_ = 0.0, barrier_ = 0.0;
};

/// Of a Hessian that rounding may have left not quite positive: with as little more on its diagonal
/// as it takes.
Eigen::LLT<Matrix> factorized(Matrix H) {
  Eigen::LLT<Matrix> llt(H);
  for (double more = 1e-14; llt.info() != Eigen::Success && more < 1.0; more *= 10.0) {
    H.diagonal() *= 1.0 + more;
    llt.compute(H);
  }
  if (llt.info() != Eigen::Success)
    throw Error(ErrorCode::numerical, "ip: the Hessian is not positive definite");
  return llt;
}

}  // namespace

RecoveryResult InteriorPoint::recover(const RecoveryProblem& problem) {
  refuse_background(problem, "ip");
  RecoveryClock clock(options_, trace_);
  const ScaledProblem scaled(problem);
  Approximation at(scaled);
  begin(problem, options_.initial, at);
  Barrier barrier(scaled, interior_.conservative);
  std::vector<Matrix> W;
  for (const Matrix& w : at.W()) W.push_back(nearest_positive(w, kInside));
  // A conservative one must begin below the dense Gaussian, if need be far below; at most half of
  // it, since next to it is next to the boundary as well.
  for (int tries = 0; !barrier.go(W) || (interior_.conservative && tries == 0); ++tries) {
    if (tries == 60) throw Error(ErrorCode::numerical, "ip: no point inside to begin with");
    for (Matrix& w : W) w *= 0.5;
  }
  clock.record(0.5 * (barrier.cost(0.0) - scaled.rank));
  double rho = std::clamp(interior_.start * barrier.balance(), 1e-8, 1e3);
  int iterations = 0;
  bool converged = false;
  // At the end the barrier holds the KLD off its minimum by at most ½ ρ for each freedom.
  const double last = std::max(1e-2 * options_.tolerance * options_.tolerance, kRounding);
  while (iterations < options_.iterations && has_time(clock)) {
    const Vector slope = barrier.slope(rho);
    const Vector step = -factorized(barrier.hessian(rho)).solve(slope);
    const double decrement = -slope.dot(step);
    ++iterations;
    bool moved = false;
    const double cost = barrier.cost(rho);
    for (double t = barrier.longest(step); t > 1e-12 && decrement > 1e-16; t *= 0.5) {
      const std::vector<Matrix> before = barrier.W();
      if (barrier.go(barrier.moved(step, t)) &&
          barrier.cost(rho) <= cost - 1e-4 * t * decrement + 1e-14 * std::abs(cost)) {
        moved = true;
        break;
      }
      barrier.go(before);
    }
    clock.record(0.5 * (barrier.cost(0.0) - scaled.rank));
    if (!moved || decrement < std::max(rho, last)) {
      if (rho <= last && (!moved || decrement < last)) {
        converged = true;
        break;
      }
      rho = std::max(rho * interior_.decrease, last);
    }
  }
  W = barrier.W();
  for (Matrix& w : W) {
    w = nearest_positive(w);
    // Λ̆ ⪯ I before; each factor has added kFloor at most.
    if (interior_.conservative) w *= 1.0 - scaled.factors() * kFloor;
  }
  if (!at.set(std::move(W)))
    throw Error(ErrorCode::numerical, "ip: the approximation became singular");
  return clock.finish(at, iterations, converged);
}

}  // namespace cairn::sparsify
