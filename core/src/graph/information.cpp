// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/information.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/core.h>

#include "cairn/graph/rounding.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn::detail {
namespace {

using Map = Eigen::Map<const Eigen::MatrixXd>;

Error bad_input(const std::string& message) { return {ErrorCode::input, message}; }

double smallest_eigenvalue(const Eigen::MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .minCoeff();
}

/// A symmetric matrix from numbers that may differ by rounding on both sides of the diagonal.
Eigen::MatrixXd symmetric(std::string_view what, std::span<const double> dense, std::int64_t rows,
                          std::int64_t columns) {
  if (rows != columns || rows == 0) {
    throw bad_input(
        fmt::format("the {} matrix is {} x {}; it must be square", what, rows, columns));
  }
  const Map A(dense.data(), rows, columns);
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (Eigen::Index column = 0; column < columns; ++column) {
      if (!std::isfinite(A(row, column))) {
        throw bad_input(fmt::format("the {} matrix is not finite: entry ({}, {}) is {}", what, row,
                                    column, A(row, column)));
      }
    }
  }
  // An inverse in single precision is as symmetric as its rounding lets it be.
  const bool floats = are_floats(dense);
  const double allowed = (floats ? 1e-5 : 1e-9) * A.cwiseAbs().maxCoeff();
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (Eigen::Index column = row + 1; column < columns; ++column) {
      if (std::abs(A(row, column) - A(column, row)) > allowed) {
        throw bad_input(
            fmt::format("the {} matrix is not symmetric: entry ({}, {}) is {}, ({}, {}) is {}",
                        what, row, column, A(row, column), column, row, A(column, row)));
      }
    }
  }
  const Eigen::MatrixXd mean = 0.5 * (A + A.transpose());
  if (!floats) return mean;
  return mean.cast<float>().cast<double>();
}

void check_semidefinite(std::span<const double> packed, int n) {
  std::vector<double> root(packed.size());
  if (square_root(packed, n, root)) return;
  throw bad_input(
      fmt::format("the information matrix is not positive semidefinite: its smallest eigenvalue is "
                  "{:.6g}",
                  smallest_eigenvalue(unpack(packed, n))));
}

}  // namespace

std::vector<double> checked_information(std::span<const double> dense, std::int64_t rows,
                                        std::int64_t columns) {
  std::vector<double> packed = pack(symmetric("information", dense, rows, columns));
  check_semidefinite(packed, static_cast<int>(rows));
  return packed;
}

std::vector<double> inverted_covariance(std::span<const double> dense, std::int64_t rows,
                                        std::int64_t columns) {
  const Eigen::MatrixXd Sigma = symmetric("covariance", dense, rows, columns);
  const Eigen::LLT<Eigen::MatrixXd> llt(Sigma);
  if (llt.info() != Eigen::Success) {
    throw bad_input(
        fmt::format("the covariance matrix is not positive definite: its smallest eigenvalue is "
                    "{:.6g}",
                    smallest_eigenvalue(Sigma)));
  }
  const Eigen::MatrixXd Omega = llt.solve(Eigen::MatrixXd::Identity(rows, rows));
  std::vector<double> packed = pack(Eigen::MatrixXd(0.5 * (Omega + Omega.transpose())));
  if (!Omega.allFinite())
    throw bad_input("the covariance matrix has no finite inverse: a variance is too small");
  return packed;
}

std::vector<double> information_of_sigmas(std::span<const double> sigmas) {
  const int n = static_cast<int>(sigmas.size());
  std::vector<double> packed(packed_size(n), 0.0);
  std::size_t diagonal = 0;
  for (int k = 0; k < n; ++k) {
    const double information = 1.0 / (sigmas[k] * sigmas[k]);
    if (!(sigmas[k] > 0.0) || !std::isfinite(information)) {
      throw bad_input(fmt::format(
          "standard deviation {} of {} is {}; it must be positive (infinity for what is "
          "not measured)",
          k + 1, n, sigmas[k]));
    }
    packed[diagonal] = information;
    diagonal += static_cast<std::size_t>(n - k);
  }
  return packed;
}

void check_packed_information(std::span<const double> packed) {
  int n = 1;
  while (packed_size(n) < packed.size()) ++n;
  if (packed.empty() || packed_size(n) != packed.size()) {
    throw bad_input(
        fmt::format("{} numbers are not an upper triangle: n x n has n(n+1)/2", packed.size()));
  }
  for (std::size_t k = 0; k < packed.size(); ++k) {
    if (!std::isfinite(packed[k])) {
      throw bad_input(
          fmt::format("the information matrix is not finite: number {} of its upper triangle is {}",
                      k + 1, packed[k]));
    }
  }
  check_semidefinite(packed, n);
}

}  // namespace cairn::detail
