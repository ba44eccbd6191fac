// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "approximation.hpp"
#include "cairn/sparsification/sparsification.hpp"

namespace cairn::sparsify {

inline Eigen::Map<const Matrix> information(const DenseBlanket& blanket) {
  return {blanket.information.data(), blanket.size(), blanket.size()};
}
inline Eigen::Map<const Matrix> jacobian(const FactorModel& model, int size) {
  return {model.jacobian.data(), model.size, size};
}
/// First tangent coordinate of each node.
std::vector<int> offsets(const DenseBlanket& blanket);
/// T of a projection, d × r.
inline Eigen::Map<const Matrix> coordinates(const BlanketProjection& projection, int size) {
  return {projection.T().data(), size, projection.rank};
}

}  // namespace cairn::sparsify
