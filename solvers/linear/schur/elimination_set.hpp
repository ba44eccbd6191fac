// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "cairn/linear/block_matrix.hpp"

namespace cairn::schur {

/// Blocks no two of which are joined by an entry, by rising size and number: those that are
/// eliminated first. `how`:
/// - smallest: the blocks of the smallest size; where some of them are joined, an independent set
///   of them.
/// - independent_set: greedily, fewest neighbours first, from all blocks but those with more than
///   twice the mean number of neighbours.
/// - auto: the blocks of the smallest size if no two of them are joined and they are at least half
///   of all blocks, as the points of a bundle adjustment are; otherwise as independent_set.
std::vector<std::int32_t> elimination_set(const BlockStructure& structure, std::string_view how);

}  // namespace cairn::schur
