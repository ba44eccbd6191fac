// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "block/supernodal_cholesky.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"

namespace cairn::block {

/// What a factorisation is computed in.
enum class Precision {
  in_double,
  mixed  ///< single, refined to what double gives
};

/// `SupernodalCholesky` in double precision, or in mixed precision: H is rounded to single
/// precision and factored there, in about half of the time and the memory; a solution then is
/// refined by conjugate gradients on H itself, in double precision, with that factor as the
/// preconditioner. H M⁻¹ differs from the identity by about 6e-8 times the condition number, and in
/// few directions by as much as that; so a few steps are enough: each takes a product with H and a
/// solve in single precision. They end when
///
///     max |g - H x|_i / d_i  ≤  1e-15 (max d_i |x_i| + max |g|_i / d_i),    d_i = √H_ii,
///
/// which is what a factorisation in double precision gives (3e-16 to 1.2e-15 on published graphs),
/// whatever the units of the variables; the residual of the result is computed anew, not carried
/// along. (Carson, Higham, "Accelerating the solution of linear systems by iterative refinement in
/// three precisions", SIAM J. Sci. Comput. 40(2), 2018; Higham, Pranesh, "Exploiting lower
/// precision arithmetic in solving symmetric positive definite linear systems and least squares
/// problems", SIAM J. Sci. Comput. 43(1), 2021.)
///
/// Where conditioning forbids that, H is factored in double precision, and so are all that follow
/// with the same structure: where a pivot is not positive in single precision, or so small beside
/// its diagonal entry that it may be rounding alone, and where ten steps are not enough. Numbers
/// beyond the range of single precision end there too.
///
/// What needs the factor itself (several right-hand sides, covariances, the determinant) has it
/// from a factorisation in double precision, which is computed then.
class RefinedCholesky {
 public:
  /// `kernels`: as for `SupernodalCholesky`.
  RefinedCholesky(std::string_view kernels, Precision precision)
      : cholesky_(kernels), precision_(precision) {}

  /// This and what follows: as for `SupernodalCholesky`.
  void analyze(const BlockStructure& structure, std::string_view ordering);
  Factorization factorize(const BlockMatrix& H);
  /// Not a number in every place if H turns out not to be positive definite only now, as may be if
  /// it is singular to double precision.
  void solve(std::span<const double> g, std::span<double> x);
  void solve(std::span<const double> G, std::span<double> X, int columns);
  void inverse_columns(std::span<const std::int64_t> scalars, std::span<double> X);
  double log_determinant();

  /// The factor in double precision, for what reads it after `require_double`.
  SupernodalCholesky& cholesky() { return cholesky_; }
  const SupernodalCholesky& cholesky() const { return cholesky_; }
  /// Factors in double precision what was last factored in single.
  void require_double();

  /// Steps of refinement since the last analysis.
  std::int64_t steps() const { return steps_; }
  /// What mixed precision did since then: solutions, steps, and why it fell back to double if it
  /// did. Empty in double precision.
  std::string description() const;

 private:
  /// x_ = H⁻¹ g_, or something else if the steps do not lead there: then false.
  bool refine();
  bool take_steps();
  void precondition();
  bool is_accurate() const;  // by r_
  bool has_safe_pivots() const;
  Factorization fall_back(std::string_view reason);

  SupernodalCholesky cholesky_;
  Precision precision_;
  bool falls_back_ = false;  // to double, for the rest of this structure
  bool is_single_ = false;   // the last good factorisation
  std::string reason_;
  std::int64_t solutions_ = 0, steps_ = 0;
  BlockMatrix H_;                      // as it was factored: the caller's may have changed since
  std::vector<double> d_, inverse_d_;  // √H_ii and 1 / √H_ii
  double scaled_g_ = 0.0;              // max |g|_i / d_i
  std::vector<double> g_;              // scaled
  std::vector<double> x_, r_, z_, p_, q_;
};

}  // namespace cairn::block
