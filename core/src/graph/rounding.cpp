// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/rounding.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "cairn/graph/packed.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {

bool settle_rounding(int n, std::span<const double> rounding, std::span<double> A) {
  const Eigen::MatrixXd given = unpack(A, n);
  Eigen::MatrixXd R = unpack(rounding, n);
  // What computing in doubles leaves of zero before anything is rounded.
  R.array() += 4.0 * std::numeric_limits<double>::epsilon() * given.cwiseAbs().maxCoeff();
  const Eigen::VectorXd size = R.diagonal().cwiseSqrt();
  const Eigen::VectorXd scale = size.cwiseInverse();
  if (!scale.allFinite() || !R.allFinite()) return false;
  const Eigen::MatrixXd scaled = scale.asDiagonal() * given * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  if (eigen.info() != Eigen::Success) return false;
  for (int k = 0; k < n && eigen.eigenvalues()(k) < 0.0; ++k) {
    const Eigen::VectorXd w = scale.cwiseProduct(eigen.eigenvectors().col(k).cwiseAbs());
    if (!(eigen.eigenvalues()(k) >= -w.dot(R * w))) return false;
  }
  const Eigen::VectorXd kept = eigen.eigenvalues().cwiseMax(0.0);
  const Eigen::MatrixXd& V = eigen.eigenvectors();
  const Eigen::MatrixXd nearest = size.asDiagonal() *
                                  Eigen::MatrixXd(V * kept.asDiagonal() * V.transpose()) *
                                  size.asDiagonal();
  std::vector<double> packed(A.size()), root(A.size());
  pack(Eigen::MatrixXd(0.5 * (nearest + nearest.transpose())), packed.data());
  if (!square_root_of_doubles(packed, n, root)) return false;
  std::ranges::copy(packed, A.begin());
  return true;
}

bool are_floats(std::span<const double> numbers) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  return std::ranges::all_of(numbers, [](double x) {
    return std::abs(x) <= kLargest && static_cast<double>(static_cast<float>(x)) == x;
  });
}

void add_float_rounding(int n, std::span<const double> A, std::span<double> rounding) {
  Eigen::VectorXd size(n);
  std::size_t k = 0;
  for (int i = 0; i < n; k += static_cast<std::size_t>(n - i++))
    size(i) = std::sqrt(std::max(A[k], 0.0));
  k = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = i; j < n; ++j) rounding[k++] += n * 0x1p-24 * size(i) * size(j);
  }
}

}  // namespace cairn
