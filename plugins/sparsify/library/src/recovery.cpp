// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sparsification/recovery.hpp"

#include <cmath>

#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"
#include "dense/lu.hpp"
#include "dense/products.hpp"

namespace cairn {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using MatrixMap = Eigen::Map<const Matrix>;

/// Eigenvalues below this part of the largest are taken for zero, after scaling to unit diagonal.
constexpr double kZero = 1e-12;
/// Diagonal elements of Λ that are squares of rounding, as a part of the largest: nothing is known
/// of that coordinate, and scaling would make rounding of it information.
constexpr double kRounding = 1e-26;

/// By a rank-revealing eigendecomposition. Λ is scaled to a unit diagonal first, since metres and
/// radians do not compare.
Matrix by_eigenvectors(const Matrix& L) {
  Vector scale = L.diagonal();
  const double least = kRounding * scale.maxCoeff();
  for (double& s : scale) s = s > least ? 1.0 / std::sqrt(s) : 0.0;
  const Matrix scaled = scale.asDiagonal() * L * scale.asDiagonal();
  const Matrix symmetric = 0.5 * (scaled + scaled.transpose());
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(symmetric);
  const Vector& values = eigen.eigenvalues();
  Eigen::Index zeros = 0;
  while (zeros < values.size() && !(values[zeros] > kZero * values[values.size() - 1])) ++zeros;
  const Eigen::Index r = values.size() - zeros;
  return scale.asDiagonal() * eigen.eigenvectors().rightCols(r) *
         values.tail(r).cwiseSqrt().cwiseInverse().asDiagonal();
}

/// With the first node held, if Λ leaves the whole open.
Matrix by_first_node(const DenseBlanket& blanket) {
  const Matrix L = MatrixMap(blanket.information.data(), blanket.size(), blanket.size());
  const Eigen::Index first = blanket.absolute ? 0 : blanket.node_sizes.front();
  const Eigen::Index r = L.rows() - first;
  const Eigen::LLT<Matrix> llt(Matrix(L.bottomRightCorner(r, r)));
  // A pivot that is rounding: the factorisation may go on in spite of it.
  const Vector pivots = llt.matrixLLT().diagonal().cwiseAbs2();
  const Vector diagonal = L.diagonal().tail(r);
  if (llt.info() != Eigen::Success || (pivots.array() <= kZero * diagonal.array()).any())
    throw Error(ErrorCode::numerical, "the blanket leaves more open than the pose of the whole");
  Matrix T = Matrix::Zero(L.rows(), r);
  T.bottomRows(r) = llt.matrixU().solve(Matrix::Identity(r, r));
  return T;
}

}  // namespace

FactorRecovery::~FactorRecovery() = default;

BlanketProjection::BlanketProjection(const DenseBlanket& blanket, Projection projection) {
  const int d = blanket.size();
  const Matrix T = projection == Projection::node
                       ? by_first_node(blanket)
                       : by_eigenvectors(MatrixMap(blanket.information.data(), d, d));
  if (T.cols() == 0) throw Error(ErrorCode::numerical, "the blanket has no information");
  rank = static_cast<int>(T.cols());
  T_.assign(T.data(), T.data() + T.size());
}

BlanketProjection project(const DenseBlanket& blanket, Projection projection) {
  if (projection == Projection::node) {
    try {
      return {blanket, Projection::node};
    } catch (const Error& error) {
      if (error.code() != ErrorCode::numerical) throw;
    }
  }
  return {blanket, Projection::eigen};
}

RecoveryProblem BlanketProjection::problem(const DenseBlanket& blanket,
                                           std::span<const FactorChoice> topology) const {
  const int d = blanket.size();
  const MatrixMap T(T_.data(), d, rank), L(blanket.information.data(), d, d);
  const std::vector<int> begin = blanket.offsets();
  RecoveryProblem problem{.rank = rank, .factors = {}, .basis = T_};
  for (const FactorChoice& choice : topology) {
    RecoveryProblem::Factor factor;
    std::vector<bool> measured(begin.size());
    for (const int model : choice) {
      factor.size += blanket.models[model].size;
      for (const int node : blanket.models[model].nodes) measured[node] = true;
    }
    for (std::size_t node = 0; node + 1 < begin.size(); ++node) {
      for (int k = begin[node]; measured[node] && k < begin[node + 1]; ++k)
        factor.columns.push_back(k);
    }
    Matrix A(factor.size, factor.columns.size());
    Matrix J(factor.size, rank);
    int row = 0;
    for (const int number : choice) {
      const FactorModel& model = blanket.models[number];
      const MatrixMap of(model.jacobian.data(), model.size, d);
      A.middleRows(row, model.size) = of(Eigen::all, factor.columns);
      J.middleRows(row, model.size) = dense::product(of, T);
      row += model.size;
    }
    factor.in_columns.assign(A.data(), A.data() + A.size());
    factor.jacobian.assign(J.data(), J.data() + J.size());
    const FactorModel& model = blanket.models[choice.front()];
    if (choice.size() == 1 && model.nodes.size() == 2) {
      const int a = model.nodes[0], b = model.nodes[1], m = model.size;
      if (blanket.node_sizes[a] == m && blanket.node_sizes[b] == m) {
        const MatrixMap of(model.jacobian.data(), m, d);
        const Matrix Ja = of.middleCols(begin[a], m).inverse();
        const Matrix Jb = of.middleCols(begin[b], m).inverse();
        const Matrix guess =
            dense::product(dense::product_of_transpose(Ja, L.block(begin[a], begin[b], m, m)), Jb);
        factor.off_diagonal.assign(guess.data(), guess.data() + guess.size());
      }
    }
    problem.factors.push_back(std::move(factor));
  }
  return problem;
}

}  // namespace cairn
