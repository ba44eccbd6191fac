// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <Eigen/SparseCholesky>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/plugin/option_fields.hpp"

namespace cairn {

struct EigenOptions {
  std::string ordering = "amd";

  static auto fields() {
    return OptionFields<EigenOptions>().choice(
        "ordering", &EigenOptions::ordering, {"amd", "natural"},
        "fill-reducing ordering, computed on the graph of the blocks");
  }
};

/// Adapter of Eigen's SimplicialLDLT: P H Pᵀ = L D Lᵀ, with P from the graph of the blocks (AMD) or
/// the order given. The permuted upper triangle is scattered straight from the blocks by a map
/// computed once per structure, so that Eigen copies nothing. H counts as positive definite if all
/// of D is.
class EigenSolver final : public LinearSolver, public LogDeterminant {
 public:
  explicit EigenSolver(const EigenOptions& options);

  void analyze(const BlockStructure& structure) override;
  Factorization factorize(const BlockMatrix& H) override;
  void solve(std::span<const double> g, std::span<double> x) override;
  const LinearSolverStats& stats() const override { return stats_; }

  double log_determinant() const override;
  void* ability(std::string_view name) override;

 private:
  using Matrix = Eigen::SparseMatrix<double>;

  /// SimplicialLDLT with access to the structure of L, which Eigen gives only after a
  /// factorisation.
  class Ldlt : public Eigen::SimplicialLDLT<Matrix, Eigen::Upper, Eigen::NaturalOrdering<int>> {
   public:
    /// Entries of a column of L below the diagonal.
    int column_entries(int column) const {
      return m_matrix.outerIndexPtr()[column + 1] - m_matrix.outerIndexPtr()[column];
    }
    double pivot(int k) const { return m_diag[k]; }
  };

  void build_permuted(const BlockStructure& structure);

  const std::string ordering_;
  std::uint64_t version_ = 0;  // of the structure that was analysed
  ScalarPattern pattern_;
  std::vector<double> values_;  // of the pattern
  std::vector<int> place_;      // in the permuted matrix, of each value of the pattern
  std::vector<int> scalars_;    // the scalar eliminated k-th
  std::vector<int> block_of_scalar_;
  Matrix permuted_;  // upper triangle of P H Pᵀ
  Ldlt ldlt_;
  Eigen::VectorXd right_;
  LinearSolverStats stats_;
  SolvedMarginals marginals_{*this};
  bool factorized_ = false;
};

}  // namespace cairn
