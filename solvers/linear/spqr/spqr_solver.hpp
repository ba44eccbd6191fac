// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <cholmod.h>

#include "cairn/linear/jacobian.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "spqr_factor.hpp"

namespace cairn {

struct SpqrOptions {
  std::string ordering = "amd";

  static auto fields() {
    return OptionFields<SpqrOptions>().choice(
        "ordering", &SpqrOptions::ordering, {"amd", "metis", "nesdis", "colamd", "natural"},
        "fill-reducing column ordering, computed on the graph of the blocks");
  }
};

/// Square-root SAM (Dellaert, Kaess 2006, section 3; Vallvé 2018, chapter 2): J P = Q R by
/// SuiteSparseQR (Davis 2011), multifrontal Householder QR of the whitened Jacobian, and
/// x = −P R⁻¹ Qᵀ r. H = JᵀJ is never formed, so rounding acts on the condition number of J, the
/// square root of that of H. Damping is appended as rows √D.
///
/// The column ordering is computed on the graph of the blocks, the symbolic analysis once per
/// structure: that of J when analysing, that of [J; √D] at the first damped factorisation. A J
/// without full column rank is a failed `Factorization` with the first block that depends on those
/// eliminated before it. J cannot be recovered from H alone: `analyze(BlockStructure)` throws
/// `Error` (usage). SuiteSparseQR keeps Q as Householder vectors and allocates a new factor each
/// time.
class SpqrSolver final : public LinearSolver, public JacobianSolver, public LogDeterminant {
 public:
  explicit SpqrSolver(const SpqrOptions& options);
  ~SpqrSolver() override;

  void analyze(const JacobianStructure& structure) override;
  Factorization factorize(const JacobianMatrix& J, std::span<const double> damping) override;
  void minimize(std::span<const double> residual, std::span<double> x) override;
  const LinearSolverStats& stats() const override { return stats_; }

  /// ln|JᵀJ + D| = 2 Σ ln|R_kk|.
  double log_determinant() const override;
  void* ability(std::string_view name) override;

  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H) override;
  /// x = (JᵀJ + D)⁻¹ g of the last factorisation of J: RᵀR x = g.
  void solve(std::span<const double> g, std::span<double> x) override;

 private:
  const std::string ordering_;
  cholmod_common common_;
  const JacobianStructure* structure_ = nullptr;
  std::uint64_t version_ = 0;
  std::vector<std::int32_t> order_;   // the block eliminated k-th
  std::vector<std::int32_t> block_;   // by scalar column in the order of elimination
  std::vector<std::int64_t> scalar_;  // likewise: its place in x
  std::vector<double> permuted_;
  std::optional<SpqrFactor> plain_, damped_;
  SpqrFactor* current_ = nullptr;  // the one that was factorised last, with success
  LinearSolverStats stats_;
  SolvedMarginals marginals_{*this};
};

}  // namespace cairn
