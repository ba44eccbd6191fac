// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "cairn/sparsification/blanket.hpp"
#include "cairn/sparsification/recovery.hpp"

namespace cairn::sparsify {

// The arrays of a blanket as Eigen's matrices.

/// Λ, d × d.
inline Eigen::Map<const Eigen::MatrixXd> information(const DenseBlanket& blanket) {
  return {blanket.information.data(), blanket.size(), blanket.size()};
}
/// J of a model, m × d, d being the blanket's size.
inline Eigen::Map<const Eigen::MatrixXd> jacobian(const FactorModel& model, int size) {
  return {model.jacobian.data(), model.size, size};
}
/// T of a projection, d × r.
inline Eigen::Map<const Eigen::MatrixXd> coordinates(const BlanketProjection& projection,
                                                     int size) {
  return {projection.T().data(), size, projection.rank};
}

}  // namespace cairn::sparsify
