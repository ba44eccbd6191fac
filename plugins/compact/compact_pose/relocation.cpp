// SPDX-License-Identifier: BSD-3-Clause
#include "relocation.hpp"

#include <cmath>

#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn::compact {

double part_of_way(const Matrix& way, const Matrix& match) {
  // In coordinates in which Σ_y is the identity and W diagonal, with entries λ:
  // lost(w) = ½ Σ ln((λ + 1/w) / (λ + 1)) − n/2 ln(1 − w).
  const Eigen::MatrixXd L = Eigen::MatrixXd(match).llt().matrixL();
  const Eigen::MatrixXd half = L.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd(way));
  const Eigen::MatrixXd whitened = L.triangularView<Eigen::Lower>().solve(half.transpose());
  const Eigen::ArrayXd lambda =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(whitened, Eigen::EigenvaluesOnly)
          .eigenvalues()
          .cwiseMax(0.0);
  const double n = static_cast<double>(lambda.size());
  // Twice its derivative, n/(1 − w) − Σ 1/(w (λ w + 1)), rises with w; at ½ it is not negative.
  const auto slope = [&](double w) {
    return n / (1.0 - w) - (w * (lambda * w + 1.0)).inverse().sum();
  };
  double low = 0.0, high = 0.5;
  for (int k = 0; k < 50; ++k) {
    const double middle = 0.5 * (low + high);
    (slope(middle) < 0.0 ? low : high) = middle;
  }
  return high;
}

}  // namespace cairn::compact
