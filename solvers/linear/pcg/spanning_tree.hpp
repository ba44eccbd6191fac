// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cairn/linear/block_matrix.hpp"
#include "iterative/diagonal_blocks.hpp"

namespace cairn {

/// How strongly each off-diagonal block couples, whatever the units: the Frobenius norm of
/// L_i⁻¹ H_ij L_j⁻ᵀ, with L Lᵀ the diagonal blocks. By entry; zero on the diagonal.
std::vector<double> coupling_strengths(const BlockMatrix& H,
                                       const iterative::DiagonalBlocks& diagonal);

/// The entries of a subgraph of the block graph, rising: a spanning forest of the largest weight
/// (Kruskal 1956), and of the other edges the `extra` with the largest stretch, that is, the
/// strength times the length of the path in the forest, with the length of an edge the inverse of
/// its strength. Ties go to the lower entry, so the choice is always the same.
std::vector<std::int64_t> choose_subgraph(const BlockStructure& structure,
                                          const std::vector<double>& strength, std::int64_t extra);

}  // namespace cairn
