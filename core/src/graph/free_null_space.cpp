// SPDX-License-Identifier: BSD-3-Clause
#include "free_null_space.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "dense/eigenvalues.hpp"

namespace cairn {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd inverse_root(const VectorXd& diagonal) {
  return diagonal.unaryExpr([](double d) { return d > 0.0 ? 1.0 / std::sqrt(d) : 1.0; });
}

MatrixXd scaled(const MatrixXd& A, const VectorXd& scale) {
  return scale.asDiagonal() * A * scale.asDiagonal();
}

namespace {

/// A direction is free where its eigenvalue of the scaled H is below this.
constexpr double kFree = 1e-13;
/// What a factor says of a direction is rounding below this part of what all say of its variables.
constexpr double kBarely = 1e-13;
/// Of scaled Gram matrices: what is smaller is rounding.
constexpr double kRounding = 1e-14;
/// What a basis vector has below this part of its largest number is rounding.
constexpr double kNoMove = 1e-9;

class NullSpace {
 public:
  explicit NullSpace(const MovingVariables& moving) : of_(moving), rows_(moving.rows) {}

  std::vector<FreeDirection> run() {
    std::vector<FreeDirection> found;
    find_movers();
    int number = 0;
    for (std::size_t p = 0; p < of_.parts.size() && rows_.finite(); ++p) {
      const Part& part = of_.parts[p];
      if (part.dead) continue;
      const MatrixXd basis = null_space(part, movers_of_[p]);
      for (Eigen::Index j = 0; j < basis.cols(); ++j) {
        FreeDirection direction = direction_of(part, movers_of_[p], basis.col(j));
        direction.part = number;
        if (!direction.moves.empty()) found.push_back(std::move(direction));
      }
      number += basis.cols() > 0;
    }
    return found;
  }

 private:
  const std::vector<Column>& columns(std::int32_t v) const {
    return of_.columns[static_cast<std::size_t>(v)];
  }

  /// The variables that move with each part, and the diagonal of their blocks of H.
  void find_movers() {
    movers_of_.resize(of_.parts.size());
    diagonal_.resize(of_.columns.size());
    double largest = 0.0;
    for (std::size_t v = 0; v < of_.columns.size(); ++v) {
      const std::vector<Column>& columns = of_.columns[v];
      if (columns.empty()) continue;
      const auto variable = static_cast<std::int32_t>(v);
      movers_of_[static_cast<std::size_t>(
                     of_.part_of[static_cast<std::size_t>(columns.front().parameter)])]
          .push_back(variable);
      diagonal_[v] = VectorXd::Zero(rows_.size(variable));
      for (const std::int32_t k : of_.factors_of(variable)) {
        if (!rows_.evaluate(k)) return;
        Eigen::Index at = 0;
        for (const std::int32_t w : rows_.variables(k)) {
          if (w == variable)
            diagonal_[v] +=
                rows_.J().middleCols(at, rows_.size(w)).colwise().squaredNorm().transpose();
          at += rows_.size(w);
        }
      }
      diagonal_[v] = rows_.largest_of_unit(variable, diagonal_[v]);
      largest = std::max(largest, diagonal_[v].maxCoeff());
    }
    for (VectorXd& of : diagonal_)
      of = of.unaryExpr([&](double d) { return d > 0.0 ? d : largest > 0.0 ? largest : 1.0; });
  }

  /// Those α of a part that no row sees, each with as many zeros as elimination gives it.
  MatrixXd null_space(const Part& part, std::span<const std::int32_t> movers) {
    const auto n = static_cast<Eigen::Index>(part.parameters.size());
    MatrixXd G = MatrixXd::Zero(n, n);  // Tᵀ D T
    for (const std::int32_t v : movers) {
      const std::vector<Column>& all = columns(v);
      for (const Column& a : all)
        for (const Column& b : all)
          G(place(part, a), place(part, b)) +=
              a.delta.dot(diagonal_[static_cast<std::size_t>(v)].cwiseProduct(b.delta));
    }
    // S a = q G a, with unit diagonal of G, and its inverse root by eigenvectors.
    const VectorXd scale = inverse_root(G.diagonal());
    const Eigen::SelfAdjointEigenSolver<MatrixXd> of_G(scaled(G, scale));
    const VectorXd root = of_G.eigenvalues().cwiseMax(kRounding).cwiseSqrt().cwiseInverse();
    const MatrixXd W = scale.asDiagonal() * of_G.eigenvectors() * root.asDiagonal();
    const MatrixXd S = W.transpose() * part.S * W;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(S);
    Eigen::Index free = 0;
    while (free < n && eigen.eigenvalues()[free] <= kFree) ++free;
    MatrixXd A = unseen(movers, part, W * eigen.eigenvectors().leftCols(free));
    // In units of the scaled parameters, so that numbers can be compared.
    A = scale.cwiseInverse().asDiagonal() * A;
    eliminate(A);
    return scale.asDiagonal() * A;
  }

  /// Of those α that rows hardly see beside all that moves with them, the ones that no row sees
  /// beside what it could see of the variables that it is on: one prior at the end of a long chain
  /// is little, and no rounding.
  MatrixXd unseen(std::span<const std::int32_t> movers, const Part& part, const MatrixXd& A) {
    if (A.cols() == 0) return A;
    std::vector<std::int32_t> factors;
    for (const std::int32_t v : movers) {
      const auto of = of_.factors_of(v);
      factors.insert(factors.end(), of.begin(), of.end());
    }
    std::ranges::sort(factors);
    factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
    MatrixXd S = MatrixXd::Zero(A.cols(), A.cols());
    for (const std::int32_t k : factors) {
      if (!rows_.evaluate(k)) return MatrixXd(A.rows(), 0);
      MatrixXd R = MatrixXd::Zero(rows_.J().rows(), A.cols());
      double most = 0.0, of_all = 0.0;
      Eigen::Index at = 0;
      for (const std::int32_t v : rows_.variables(k)) {
        MatrixXd moved = MatrixXd::Zero(rows_.size(v), A.cols());
        for (const Column& column : columns(v)) moved += column.delta * A.row(place(part, column));
        const auto J = rows_.J().middleCols(at, rows_.size(v));
        const VectorXd D = rows_.largest_of_unit(v, J.colwise().squaredNorm().transpose());
        const VectorXd& diagonal = diagonal_[static_cast<std::size_t>(v)];
        if (diagonal.size() > 0) of_all += (diagonal.asDiagonal() * moved.cwiseAbs2()).sum();
        R += J * moved;
        most += (D.asDiagonal() * moved.cwiseAbs2()).sum();
        at += rows_.size(v);
      }
      most = std::max(most, kBarely * of_all);
      if (most > 0.0) S += R.transpose() * R / most;
    }
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(S);
    Eigen::Index free = 0;
    while (free < A.cols() && eigen.eigenvalues()[free] <= kFree) ++free;
    return A * eigen.eigenvectors().leftCols(free);
  }

  static Eigen::Index place(const Part& part, const Column& column) {
    return std::ranges::find(part.parameters, column.parameter) - part.parameters.begin();
  }

  /// Gauss-Jordan elimination of columns with complete pivoting.
  static void eliminate(MatrixXd& A) {
    std::vector<bool> used(static_cast<std::size_t>(A.rows()), false);
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      Eigen::Index row = -1, column = j;
      for (Eigen::Index c = j; c < A.cols(); ++c) {
        for (Eigen::Index r = 0; r < A.rows(); ++r) {
          if (used[static_cast<std::size_t>(r)]) continue;
          if (row < 0 || std::abs(A(r, c)) > std::abs(A(row, column))) row = r, column = c;
        }
      }
      if (row < 0 || A(row, column) == 0.0) return;
      used[static_cast<std::size_t>(row)] = true;
      A.col(j).swap(A.col(column));
      A.col(j) /= A(row, j);
      for (Eigen::Index c = 0; c < A.cols(); ++c) {
        if (c == j) continue;
        const double factor = A(row, c);
        A.col(c) -= factor * A.col(j);
        A(row, c) = 0.0;
      }
    }
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      const double least = kNoMove * A.col(j).cwiseAbs().maxCoeff();
      A.col(j) = A.col(j).unaryExpr([&](double a) { return std::abs(a) > least ? a : 0.0; });
    }
  }

  FreeDirection direction_of(const Part& part, std::span<const std::int32_t> movers,
                             const VectorXd& alpha) {
    FreeDirection direction;
    double largest = 0.0;
    for (const std::int32_t v : movers) {
      VectorXd delta = VectorXd::Zero(rows_.size(v));
      for (const Column& column : columns(v)) delta += alpha[place(part, column)] * column.delta;
      const VectorXd weighed =
          delta.cwiseProduct(diagonal_[static_cast<std::size_t>(v)].cwiseSqrt());
      largest = std::max(largest, weighed.cwiseAbs().maxCoeff());
      direction.moves.push_back({v, {delta.data(), delta.data() + delta.size()}});
    }
    std::erase_if(direction.moves, [&](const FreeMove& move) {
      const VectorXd weighed =
          Eigen::Map<const VectorXd>(move.delta.data(), std::ssize(move.delta))
              .cwiseProduct(diagonal_[static_cast<std::size_t>(move.variable)].cwiseSqrt());
      return !(weighed.cwiseAbs().maxCoeff() > kNoMove * largest);
    });
    std::ranges::sort(direction.moves, {}, &FreeMove::variable);
    return direction;
  }

  const MovingVariables& of_;
  EquilibratedRows& rows_;
  std::vector<std::vector<std::int32_t>> movers_of_;  // by part
  std::vector<VectorXd> diagonal_;                    // by variable
};

}  // namespace

std::vector<FreeDirection> free_null_space(const MovingVariables& moving) {
  return NullSpace(moving).run();
}

}  // namespace cairn
