// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "cairn/linear/block_matrix.hpp"

namespace cairn::test {

/// A random connected block pattern: a chain and `extra` further pairs.
BlockStructure random_structure(std::mt19937& rng, int blocks, int extra,
                                const std::vector<std::int32_t>& sizes_to_mix);

/// The pattern of a solid block of side³ variables, each joined to its neighbours on six sides.
BlockStructure solid_grid(int side, std::int32_t size);

/// Random values that make the matrix symmetric positive definite: diagonally dominant by blocks.
void fill_positive_definite(std::mt19937& rng, BlockMatrix& H);

/// The whole symmetric matrix.
Eigen::MatrixXd dense(const BlockMatrix& H);

}  // namespace cairn::test
