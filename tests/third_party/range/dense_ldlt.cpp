// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <span>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"

namespace {

/// Copies the blocks into one dense matrix and leaves the rest to Eigen. O(n³): for a few hundred
/// rows.
class DenseLdlt final : public cairn::LinearSolver {
 public:
  void analyze(const cairn::BlockStructure& structure) override {
    const auto n = static_cast<Eigen::Index>(structure.size());
    dense_.resize(n, n);
    stats_ = {.ordering = "natural",
              .factor_nonzeros = n * (n + 1) / 2,
              .factor_flops =
                  static_cast<double>(n) * static_cast<double>(n) * static_cast<double>(n) / 3.0,
              .note = "dense"};
  }

  cairn::Factorization factorize(const cairn::BlockMatrix& H) override {
    const cairn::BlockStructure& structure = H.structure();
    dense_.setZero();
    for (int column = 0; column < structure.blocks(); ++column) {
      for (auto entry = structure.column_begin()[column];
           entry < structure.column_begin()[column + 1]; ++entry) {
        const int row = structure.rows()[entry];
        const int rows = structure.block_size(row), columns = structure.block_size(column);
        dense_.block(structure.offsets()[row], structure.offsets()[column], rows, columns) =
            Eigen::Map<const Eigen::MatrixXd>(H.block(entry), rows, columns);
      }
    }
    ldlt_.compute(dense_.selfadjointView<Eigen::Lower>());
    // Eigen pivots, so it cannot say at which block the matrix stopped being positive definite.
    const Eigen::ArrayXd d = ldlt_.vectorD().array();  // not finite where H is not
    const bool ok = ldlt_.info() == Eigen::Success && d.isFinite().all() && (d > 0.0).all();
    return {.ok = ok, .failed_block = -1};
  }

  void solve(std::span<const double> g, std::span<double> x) override {
    const auto n = static_cast<Eigen::Index>(g.size());
    const Eigen::VectorXd solution = ldlt_.solve(Eigen::Map<const Eigen::VectorXd>(g.data(), n));
    Eigen::Map<Eigen::VectorXd>(x.data(), n) = solution;
  }

  const cairn::LinearSolverStats& stats() const override { return stats_; }

 private:
  Eigen::MatrixXd dense_;
  Eigen::LDLT<Eigen::MatrixXd> ldlt_;
  cairn::LinearSolverStats stats_;
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>("dense_ldlt", {}, [](const cairn::Options&, cairn::Registry&) {
    return std::make_unique<DenseLdlt>();
  });
}
