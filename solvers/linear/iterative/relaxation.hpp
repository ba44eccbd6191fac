// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/iterative_solver.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "iterative/block_rows.hpp"
#include "iterative/diagonal_blocks.hpp"
#include "iterative/progress.hpp"

namespace cairn::iterative {

struct RelaxationOptions {
  double tolerance = 1e-10;  ///< on ‖Hx − g‖/‖g‖, also in the norm of D⁻¹
  /// Sweeps of one solve; 0: as many as 3·10⁸ multiplications allow, some tenths of a second.
  std::int64_t max_iterations = 0;

  /// `sweeps`: help of `max_iterations`.
  static OptionFields<RelaxationOptions> fields(std::string sweeps) {
    using O = RelaxationOptions;
    return OptionFields<O>()
        .real("tolerance", &O::tolerance, 1e-15, 0.1,
              "on the relative residual |Hx - g| / |g|, also with each block scaled by that of the "
              "diagonal, which is the same in all units")
        .integer("max_iterations", &O::max_iterations, 0, 1e12, std::move(sweeps));
  }
};

/// What block Jacobi and block Gauss-Seidel share: stationary iterations x ← x + M⁻¹ (g − H x) from
/// x = 0 until the residual is small or the sweeps are used up (Saad 2003, chapter 4).
///
/// Every so many sweeps the residual r and the quadratic model φ(x) = ½ xᵀHx − gᵀx are evaluated. A
/// convergent iteration lowers φ always, while ‖r‖, which mixes units, may rise for a while; so φ
/// detects divergence. The best x is returned in any case, and the note reports how the solves
/// ended. A failed factorisation is a diagonal block that is not positive definite; an H that is
/// indefinite beyond that shows as divergence.
class Relaxation : public LinearSolver, public IterativeSolver {
 public:
  void analyze(const BlockStructure& structure) final;
  Factorization factorize(const BlockMatrix& H) final;
  void solve(std::span<const double> g, std::span<double> x) final;
  const LinearSolverStats& stats() const final { return stats_; }
  double tolerance() const final { return options_.tolerance; }
  void* ability(std::string_view name) final {
    return name == IterativeSolver::kAbility ? static_cast<IterativeSolver*>(this) : nullptr;
  }

 protected:
  Relaxation(std::string name, RelaxationOptions options);
  /// One sweep on x; may use `residual()` as room.
  virtual void sweep(std::span<const double> g, std::span<double> x) = 0;
  /// How many products with H a sweep costs about.
  virtual int products_per_sweep() const { return 1; }
  /// Called when H has been loaded.
  virtual void prepare() {}
  /// Called on divergence; true if another try from zero, damped more, makes sense.
  virtual bool damp_more() { return false; }
  virtual std::string note() const = 0;

  const BlockRows& H() const { return H_; }
  const DiagonalBlocks& diagonal() const { return diagonal_; }
  std::span<double> residual() { return r_; }

 private:
  /// ‖r‖, and √(rᵀ D⁻¹ r) with the diagonal blocks D of H: in nanometres the first is that of the
  /// rotations' part alone, in kilometres that of the translations'.
  struct Norms {
    double plain = 0.0, scaled = 0.0;
  };
  Norms norms(std::span<const double> r);
  /// r = g − H x; returns φ(x), and the norms of r.
  double look(std::span<const double> x, Norms& norm);
  std::int64_t limit() const;
  /// Sweeps from zero into best_, until r is small beside g, whose norms are `whole`; returns ‖r‖.
  double iterate(const Norms& whole, std::int64_t& iterations, Ending& ending);

  const std::string name_;
  const RelaxationOptions options_;
  std::uint64_t version_ = 0;  // of the structure that was analysed
  BlockRows H_;
  DiagonalBlocks diagonal_;
  std::vector<double> g_, x_, r_, scaled_, best_;
  Progress progress_;
  LinearSolverStats stats_;
  bool factorized_ = false;
};

}  // namespace cairn::iterative
