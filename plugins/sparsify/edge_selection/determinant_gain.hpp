// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "linear_model.hpp"

namespace cairn::edges {

/// ln |Λ| while candidates are added to it. With M_k = J_k Λ⁻¹ J_kᵀ a candidate adds
/// ln |I + M_k| (the determinant lemma), and takes X (I + M_k)⁻¹ Xᵀ, X = Λ⁻¹ J_kᵀ, from the
/// covariance (Woodbury). The covariance itself is never formed: it is that of the last
/// factorisation, of which the blocks of the candidates are known, less Q Qᵀ with a few columns for
/// each candidate added since. After `kRank` columns Λ is factorised again.
class DeterminantGain {
 public:
  /// `solver` must outlive this object and serve no other in between. Throws `Error` as that and
  /// `check_solver` do.
  DeterminantGain(LinearModel model, LinearSolver& solver);

  /// ln |Λ + J_kᵀJ_k| − ln |Λ|.
  double gain(int k) const;
  void add(int k);

 private:
  static constexpr Eigen::Index kRank = 96;

  Eigen::MatrixXd J_times_Q(int k) const;  ///< J_k Q, of the columns in use
  Eigen::MatrixXd covariance(int k) const;
  void factorize();
  void solve(Eigen::MatrixXd& X);  ///< X becomes Λ₀⁻¹ X, of the last factorisation

  LinearModel model_;
  LinearSolver* solver_;
  std::vector<Eigen::MatrixXd> S_;  ///< of the candidates, at the last factorisation
  Eigen::MatrixXd Q_;
  Eigen::Index rank_ = 0;  ///< columns of Q in use
};

}  // namespace cairn::edges
