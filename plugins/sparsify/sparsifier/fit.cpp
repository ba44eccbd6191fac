// SPDX-License-Identifier: BSD-3-Clause
#include "fit.hpp"

#include <cmath>
#include <utility>

#include "blanket_matrices.hpp"
#include "dense/cholesky.hpp"
#include "dense/products.hpp"

namespace cairn::sparsify {
namespace {

/// What is left of a diagonal element, as a part of it, where a matrix is singular.
constexpr double kSingular = 1e-11;

/// Of the first node, which Λ leaves open; 0 where it leaves nothing open.
Eigen::Index open_size(const DenseBlanket& blanket) {
  return blanket.absolute ? 0 : blanket.node_sizes.front();
}

/// A⁻¹ B, or nothing.
std::optional<Matrix> solved(const Matrix& A, const Matrix& B) {
  const Eigen::LLT<Matrix> llt(A);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Vector pivots = llt.matrixLLT().diagonal().cwiseAbs2();
  if (!(pivots.array() > kSingular * A.diagonal().array()).all()) return std::nullopt;
  return llt.solve(B);
}

/// P = (−X, I), r × d. Nothing where Λ_rr is singular.
std::optional<Matrix> relative(const DenseBlanket& blanket) {
  const Matrix L = information(blanket);
  const Eigen::Index first = open_size(blanket), r = L.rows() - first;
  Matrix P = Matrix::Zero(r, L.rows());
  P.rightCols(r).setIdentity();
  if (r == 0) return std::nullopt;
  const std::optional<Matrix> minus_X =
      solved(L.bottomRightCorner(r, r),
             first > 0 ? Matrix(L.bottomLeftCorner(r, first)) : Matrix(Matrix::Zero(r, 1)));
  if (!minus_X) return std::nullopt;
  if (first > 0) P.leftCols(first) = *minus_X;
  return P;
}

}  // namespace

Matrix joint_covariance(const Graph& graph, GraphMarginals& marginals,
                        std::span<const int> variables) {
  std::vector<std::pair<int, int>> pairs;
  std::vector<Eigen::Index> begin{0};
  for (std::size_t i = 0; i < variables.size(); ++i) {
    begin.push_back(begin.back() + graph.type(variables[i]).tangent_size());
    for (std::size_t k = 0; k <= i; ++k) pairs.emplace_back(variables[i], variables[k]);
  }
  const std::vector<double> blocks = marginals.blocks(pairs);
  Matrix joint(begin.back(), begin.back());
  const double* block = blocks.data();
  for (std::size_t i = 0; i < variables.size(); ++i) {
    for (std::size_t k = 0; k <= i; ++k) {
      const Eigen::Index rows = begin[i + 1] - begin[i], columns = begin[k + 1] - begin[k];
      const Eigen::Map<const Matrix> of(block, rows, columns);
      joint.block(begin[i], begin[k], rows, columns) = of;
      joint.block(begin[k], begin[i], columns, rows) = of.transpose();
      block += rows * columns;
    }
  }
  return joint;
}

std::optional<Matrix> own_covariance(const DenseBlanket& blanket, const Matrix& joint) {
  const std::optional<Matrix> P = relative(blanket);
  if (!P) return std::nullopt;
  const Matrix S = dense::congruent(*P, joint);
  if (!solved(S, Matrix::Zero(S.rows(), 1))) return std::nullopt;
  return Matrix(0.5 * (S + S.transpose()));
}

double certainty_scale(const DenseBlanket& blanket, std::span<const FactorChoice> topology,
                       const std::vector<std::vector<double>>& information_of, const Matrix& S) {
  const int d = blanket.size();
  const Eigen::Index r = S.rows();
  double sparse = 0.0;
  for (std::size_t k = 0; k < topology.size(); ++k) {
    int rows = 0;
    for (const int model : topology[k]) rows += blanket.models[model].size;
    Matrix J(rows, r);
    int row = 0;
    for (const int number : topology[k]) {
      const FactorModel& model = blanket.models[number];
      J.middleRows(row, model.size) = jacobian(model, d).rightCols(r);
      row += model.size;
    }
    const Eigen::Map<const Matrix> Omega(information_of[k].data(), rows, rows);
    sparse += Omega.cwiseProduct(dense::congruent(J, S)).sum();
  }
  const double dense = information(blanket).bottomRightCorner(r, r).cwiseProduct(S).sum();
  return sparse > 0.0 && dense > 0.0 ? dense / sparse : 1.0;
}

void scale(const RecoveryProblem& problem, double s, RecoveryResult& result) {
  const ScaledProblem units(problem);
  std::vector<Matrix> W;
  double trace = 0.0;  // of Λ̆
  for (int k = 0; k < units.factors(); ++k) {
    std::vector<double>& information = result.information[k];
    for (double& x : information) x *= s;
    W.push_back(units.scaled(
        k, Eigen::Map<const Matrix>(information.data(), units.size(k), units.size(k))));
    trace += W.back().trace() / s;
  }
  result.kld += 0.5 * ((s - 1.0) * trace - problem.rank * std::log(s));
  if (Approximation at(units); at.set(std::move(W))) result.gradient = at.gradient();
}

DenseBlanket within_graph(DenseBlanket blanket, const Matrix& S) {
  const std::optional<Matrix> P = relative(blanket);
  const std::optional<Matrix> inverse = solved(S, Matrix::Identity(S.rows(), S.rows()));
  if (!P || !inverse) return blanket;
  const Matrix whole =
      dense::congruent_of_transpose(*P, Matrix(0.5 * (*inverse + inverse->transpose())));
  blanket.information.assign(whole.data(), whole.data() + whole.size());
  return blanket;
}

std::vector<double> background(const DenseBlanket& whole, const DenseBlanket& blanket,
                               const BlanketProjection& projection) {
  const Matrix T = coordinates(projection, blanket.size());
  const Matrix rest = information(whole) - information(blanket);
  const Matrix R = nearest_positive(dense::congruent_of_transpose(T, rest), 0.0);
  return {R.data(), R.data() + R.size()};
}

}  // namespace cairn::sparsify
