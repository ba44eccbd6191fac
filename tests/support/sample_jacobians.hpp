// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "cairn/linear/block_matrix.hpp"
#include "cairn/linear/jacobian.hpp"

namespace cairn::test {

/// A Jacobian whose JᵀJ has the blocks of `structure`: a factor of three rows for each off-diagonal
/// block, and one for each block by itself, with as many rows as it has columns.
JacobianStructure jacobian_structure(const BlockStructure& structure);

/// Random values, with `prior` times the identity added to the factors on one block: full column
/// rank. The residual is random too. The same seed gives the same values.
void fill_full_rank(JacobianMatrix& J, std::uint64_t seed, double prior = 1.0);

Eigen::MatrixXd dense(const JacobianMatrix& J);

}  // namespace cairn::test
