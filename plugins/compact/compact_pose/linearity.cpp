// SPDX-License-Identifier: BSD-3-Clause
#include "linearity.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "cairn/geometry/pose.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn::compact {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd beside_pose(const RigidGroup& group, const PlacedState& pose, const VariableType& type,
                     std::span<const double> landmark, const MatrixXd& joint) {
  const Index size = type.tangent_size(), n = group.tangent_size();
  const int dimension = group.dimension();
  const std::vector<double> derivative = position_jacobian(type, landmark);
  const Eigen::Map<const MatrixXd> G(derivative.data(), dimension, size);
  const MatrixXd carried =
      group.point_jacobian(pose.at, position(type, landmark)).topRows(dimension);
  MatrixXd C = MatrixXd::Identity(size, size + n);
  const Eigen::LLT<MatrixXd> llt(MatrixXd(G.transpose() * G));
  C.rightCols(n) = -llt.solve(MatrixXd(G.transpose() * carried));
  return C * joint * C.transpose();
}

double nonlinearity(const LandmarkView& view, const ObservationRows& rows, const MatrixXd& S) {
  constexpr double kNotAtAll = std::numeric_limits<double>::infinity();
  if (!S.allFinite() || !rows.J_landmark.allFinite()) return kNotAtAll;
  const MatrixXd& J = rows.J_landmark;
  const Eigen::LLT<MatrixXd> V(
      MatrixXd(MatrixXd::Identity(J.rows(), J.rows()) + J * S * J.transpose()));
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(S);
  const MatrixXd axes =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  std::vector<double> there(view.landmark.size());
  VectorXd signs = VectorXd::Constant(axes.cols(), -1.0);
  double most = 0.0;
  for (;;) {
    const VectorXd step = axes * signs;
    const std::int64_t first = 0;
    view.type.retract(1, view.landmark.data(), &first, step.data(), there.data());
    const VectorXd e = linearized(view.factors, view.pose, view.x.data(), there.data()).e;
    const VectorXd d = e - rows.e - J * step;
    const double squared = d.dot(V.solve(d));
    if (!std::isfinite(squared)) return kNotAtAll;
    most = std::max(most, squared);
    Index k = 0;  // the next of {−1, 0, 1}ⁿ
    while (k < signs.size() && signs[k] == 1.0) signs[k++] = -1.0;
    if (k == signs.size()) return std::sqrt(most);
    signs[k] += 1.0;
  }
}

}  // namespace cairn::compact
