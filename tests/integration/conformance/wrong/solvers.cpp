// SPDX-License-Identifier: BSD-3-Clause
// Linear solvers that are wrong: one sees the diagonal blocks alone, the other takes everything for
// positive definite.
#include <memory>
#include <span>
#include <string>

#include <Eigen/LU>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"

namespace {

class DenseSolver : public cairn::LinearSolver {
 public:
  explicit DenseSolver(bool diagonal_alone) : diagonal_alone_(diagonal_alone) {}

  void analyze(const cairn::BlockStructure& structure) override {
    H_.resize(structure.size(), structure.size());
    stats_.ordering = "natural";
  }
  cairn::Factorization factorize(const cairn::BlockMatrix& H) override {
    const cairn::BlockStructure& s = H.structure();
    H_.setZero();
    for (int column = 0; column < s.blocks(); ++column) {
      for (auto e = s.column_begin()[column]; e < s.column_begin()[column + 1]; ++e) {
        const int row = s.rows()[e];
        const Eigen::Map<const Eigen::MatrixXd> block(H.block(e), s.block_size(row),
                                                      s.block_size(column));
        if (diagonal_alone_ && row != column) continue;
        H_.block(s.offsets()[row], s.offsets()[column], block.rows(), block.cols()) = block;
        H_.block(s.offsets()[column], s.offsets()[row], block.cols(), block.rows()) =
            block.transpose();
      }
    }
    lu_.compute(H_);
    return {};
  }
  void solve(std::span<const double> g, std::span<double> x) override {
    const Eigen::VectorXd solution =
        lu_.solve(Eigen::Map<const Eigen::VectorXd>(g.data(), std::ssize(g)));
    Eigen::Map<Eigen::VectorXd>(x.data(), std::ssize(x)) = solution;
  }
  const cairn::LinearSolverStats& stats() const override { return stats_; }

 private:
  bool diagonal_alone_;
  Eigen::MatrixXd H_;
  Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
  cairn::LinearSolverStats stats_;
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "diagonal_alone", {},
      [](const cairn::Options&, cairn::Registry&) { return std::make_unique<DenseSolver>(true); });
  registrar.add<cairn::LinearSolver>("careless", {}, [](const cairn::Options&, cairn::Registry&) {
    return std::make_unique<DenseSolver>(false);
  });
}
