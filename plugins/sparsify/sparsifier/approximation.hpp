// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/sparsification/recovery.hpp"

namespace cairn::sparsify {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// Smallest eigenvalue of a factor's information, in units in which its optimum alone is 1.
inline constexpr double kFloor = 1e-7;

/// A recovery problem in units in which each factor's optimum without the others would be the
/// identity: with Φ = (J Jᵀ)⁻¹, Q = Φ^½ J has orthonormal rows, and Ω = Φ^½ W Φ^½. The cost is then
///
///     2 KLD = tr R + Σ_k tr W_k − ln |R + Σ_k Q_kᵀ W_k Q_k| − r
///
/// and its gradient by W_k I − M_k, M_k = Q_k Λ̆⁻¹ Q_kᵀ; R is the problem's background, mostly zero.
struct ScaledProblem {
  /// Throws `Error` (numerical) where a Jacobian is not of full rank.
  explicit ScaledProblem(const RecoveryProblem& problem);

  int rank = 0;
  std::vector<Matrix> Q;         ///< m × r
  std::vector<Matrix> Phi_root;  ///< Φ^½, symmetric
  /// Q_k = A_k T(columns_k, ·); where the problem has no such form, T is the identity.
  Matrix T;               ///< d × r
  Matrix background;      ///< R, r × r
  std::vector<Matrix> A;  ///< m × columns
  std::vector<std::vector<int>> columns;

  int factors() const { return static_cast<int>(Q.size()); }
  int size(int k) const { return static_cast<int>(Q[k].rows()); }
  Matrix information(int k, const Matrix& W) const { return Phi_root[k] * W * Phi_root[k]; }
  Matrix scaled(int k, const Matrix& information) const;
};

/// Throws `Error` (usage) if a problem has a background, which the method of this name does not
/// solve.
void refuse_background(const RecoveryProblem& problem, const char* method);

/// The nearest symmetric positive semidefinite matrix in the Frobenius norm, with eigenvalues of at
/// least `floor` (Higham 1988).
Matrix nearest_positive(const Matrix& A, double floor = kFloor);

/// Λ̆ = R + Σ_k Q_kᵀ W_k Q_k, its inverse S as V = T S Tᵀ, and all M_k = A_k V A_kᵀ, while single
/// W_k change.
///
/// The information of the other factors in the space of factor k is, by the matrix inversion lemma,
///
///     (Q_k Υ_k⁻¹ Q_kᵀ)⁻¹ = M_k⁻¹ − W_k,   Υ_k = Λ̆ − Q_kᵀ W_k Q_k,
///
/// which holds where Υ_k is singular as well (then M_k⁻¹ − W_k is what is left of it once all other
/// directions are eliminated; zero where no other factor measures the same). So all three
/// propositions of factor descent (T 4.12, 4.13, 4.15) are one formula in m × m matrices, and a
/// step changes V by rank m; what it costs otherwise depends on the columns of A_k alone.
class Approximation {
 public:
  explicit Approximation(const ScaledProblem& problem);

  /// Sets all W anew and factorises. False if Λ̆ is singular.
  bool set(std::vector<Matrix> W);
  /// Computes V and all M anew from W; false if Λ̆ is singular.
  bool refresh();
  /// Changes one W, and V and M with it: of all factors, or, after `follow`, of those alone, which
  /// is faster where there are many.
  void change(int k, const Matrix& W);
  void follow(std::vector<int> factors);
  /// Computes M of all factors anew from V, and follows all again.
  void follow_all();

  const ScaledProblem& problem() const { return *problem_; }
  const Matrix& W(int k) const { return W_[k]; }
  const std::vector<Matrix>& W() const { return W_; }
  const Matrix& M(int k) const { return M_[k]; }
  const Matrix& V() const { return V_; }
  double kld() const;

  /// The W_k that minimises the cost while the others stay, under W_k ⪰ `floor`, and the KLD that
  /// this gains. With B = M_k⁻¹ − W_k = V diag(β) Vᵀ it is V diag(max(1 − β, floor)) Vᵀ: for any
  /// X = B + W ⪰ B, tr X − ln |X| is least where each eigenvalue is max(1, β) in the same basis. (T
  /// sets the negative eigenvalues of Ω_k to ε instead, which is not the minimum.)
  struct Best {
    Matrix W;
    double gain = 0.0;  ///< [nats]
  };
  Best best(int k, double floor = kFloor) const;
  /// What `best` gains at most, without an eigendecomposition [nats].
  double bound(int k) const;
  /// Largest element of `RecoveryResult::gradient`.
  double gradient() const;

 private:
  const ScaledProblem* problem_;
  std::vector<Matrix> W_, M_;
  Matrix V_;
  double trace_ = 0.0, log_determinant_ = 0.0;
  std::vector<int> followed_;    ///< those whose M is kept
  Matrix VAt_, CVA_, R_, part_;  // room
};

}  // namespace cairn::sparsify
