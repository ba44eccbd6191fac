// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/iterative_solver.hpp"
#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "iterative/block_rows.hpp"
#include "iterative/diagonal_blocks.hpp"
#include "iterative/progress.hpp"
#include "pcg/normal_blocks.hpp"
#include "pcg/preconditioner.hpp"

namespace cairn {

/// What is solved exactly in each iteration.
enum class Preconditioning { automatic, block_jacobi, incomplete_cholesky, subgraph };

constexpr auto enum_names(Preconditioning) {
  return std::to_array<EnumName<Preconditioning>>(
      {{Preconditioning::automatic, "auto"},
       {Preconditioning::block_jacobi, "block_jacobi"},
       {Preconditioning::incomplete_cholesky, "incomplete_cholesky"},
       {Preconditioning::subgraph, "subgraph"}});
}

struct PcgOptions {
  Preconditioning preconditioner = Preconditioning::automatic;
  double tolerance = 1e-10;             ///< on ‖Hx − g‖/‖g‖, and with blocks scaled
  bool inexact = false;                 ///< solves end where an optimizer's steps allow it
  std::int64_t max_iterations = 20000;  ///< of one solve
  double loops = 0.3;                   ///< of `Subgraph`

  static auto fields() {
    using O = PcgOptions;
    return OptionFields<O>()
        .choice("preconditioner", &O::preconditioner,
                "what is solved exactly in each iteration; auto: incomplete_cholesky, and of a "
                "matrix that is nearly dense, as the reduced one of cameras that share points, "
                "block_jacobi")
        .real("tolerance", &O::tolerance, 1e-15, 0.1,
              "on the relative residual |Hx - g| / |g|, also with each block scaled by that of the "
              "diagonal of H")
        .boolean(
            "inexact", &O::inexact,
            "end the solves for an optimizer's steps at a relative residual of up to 0.05, the "
            "less g has shrunk since the step before: good for cameras that share many points; "
            "along a trajectory, whose slow modes hardly show in the residual, it may fail")
        .integer("max_iterations", &O::max_iterations, 1, 1e9,
                 "of one solve; a step that has not converged by then is used, and reported")
        .real("loops", &O::loops, 0.0, 1e3,
              "subgraph: loop closures taken besides the spanning tree, as a fraction of the "
              "blocks");
  }
};

/// Conjugate gradients (Hestenes, Stiefel 1952) on the blocks of H with a preconditioner (Saad
/// 2003, algorithm 9.1). H is never factorised: memory is that of H and of the preconditioner, and
/// time goes with the square root of the condition number.
///
/// A solve ends when ‖Hx − g‖ ≤ tolerance · ‖g‖, in both of the norms below, by the true residual,
/// or at max_iterations with the x that it has; either way x is used, since each iterate of
/// conjugate gradients lowers the quadratic model (Steihaug 1983), and the note of `stats` says how
/// often. That H is not positive definite is a failed factorisation where a diagonal block, or the
/// preconditioner, shows it; where only a direction p with pᵀHp ≤ 0 does, in a solve, the x so far
/// is returned and reported. An H that is only semidefinite, as under a free gauge, is solved all
/// the same: where the preconditioner is nearly singular then, and its solution leaves more than a
/// tenth of g, the diagonal blocks take its place.
///
/// Sums are taken in a fixed order: results do not depend on the number of threads.
///
/// With a preconditioner that needs the factors it has the ability `JacobianSolver`, and forms H
/// from J by itself.
class PcgSolver final : public LinearSolver, public IterativeSolver, public JacobianSolver {
 public:
  PcgSolver(std::unique_ptr<Preconditioner> preconditioner, const PcgOptions& options);

  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H) override;
  void solve(std::span<const double> g, std::span<double> x) override;
  const LinearSolverStats& stats() const override { return stats_; }
  double tolerance() const override { return options_.tolerance; }
  bool set_forcing(double term) override {
    if (options_.inexact) forcing_ = term;
    return options_.inexact;
  }

  void analyze(const JacobianStructure& structure) override;
  Factorization factorize(const JacobianMatrix& J, std::span<const double> damping) override;
  void minimize(std::span<const double> residual, std::span<double> x) override;
  void* ability(std::string_view name) override;

 private:
  Factorization factorize(const BlockMatrix& H, const NormalBlocks* factors);
  /// ‖r‖, and √(rᵀ D⁻¹ r) with the diagonal blocks D of H: the first is that of what has the
  /// largest numbers alone, such as the most certain of the measurements.
  struct Norms {
    double plain = 0.0, scaled = 0.0;
    bool within(const Norms& goal) const { return plain <= goal.plain && scaled <= goal.scaled; }
  };
  struct Outcome {
    Norms residual;
    iterative::Ending ending;
  };
  /// x = H⁻¹ g_ from 0, as far as it goes; `whole`: the norms of g. Adds to `iterations`.
  Outcome solve_with(Preconditioner& preconditioner, const Norms& whole, std::span<double> x,
                     std::int64_t& iterations);
  /// Improves x until its residual r is small; both are kept up to date. Adds to `iterations`.
  iterative::Ending iterate(Preconditioner& preconditioner, const Norms& goal, std::span<double> x,
                            std::int64_t& iterations);
  Norms true_residual(std::span<const double> x);
  double scaled_norm();  ///< of r
  /// r = r − α q, x = x + α p; returns ‖r‖².
  double step(double alpha, std::span<double> x);

  std::unique_ptr<Preconditioner> preconditioner_;
  const PcgOptions options_;
  std::uint64_t version_ = 0;           // of the structure that was analysed
  std::uint64_t jacobian_version_ = 0;  // likewise, 0 if it was one of H
  NormalBlocks factors_;
  BlockMatrix normal_;  // JᵀJ + D
  iterative::BlockRows H_;
  iterative::DiagonalBlocks diagonal_;
  std::vector<double> g_, r_, z_, p_, q_, scaled_;
  iterative::Progress progress_;
  LinearSolverStats stats_;
  bool factorized_ = false;
  double forcing_ = 0.0;
};

}  // namespace cairn
