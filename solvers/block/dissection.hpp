// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cairn/linear/block_matrix.hpp"

namespace cairn::block {

/// Nested dissection (George 1973) of the block graph, as groups: a number for each block, and
/// blocks with smaller numbers are to be eliminated first, each group by itself in any order, such
/// as that of minimum degree with constraints.
///
/// First come blocks with very few neighbours, then the pieces into which METIS's vertex separators
/// cut the rest, each separator after what it separates. `outer`: coarser groups, numbered from 0
/// without gaps, that must be kept to; each is dissected by itself. May be empty. The same
/// structure gives the same groups every time. Throws `Error` (usage) if METIS refuses.
std::vector<std::int32_t> dissection(const BlockStructure& structure,
                                     std::span<const std::int32_t> outer);

}  // namespace cairn::block
