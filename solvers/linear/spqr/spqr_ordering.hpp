// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <cholmod.h>

#include "cairn/linear/jacobian.hpp"

namespace cairn {

/// The order in which the unknown blocks of a Jacobian are eliminated: element k is the block
/// eliminated k-th. It is computed on the graph of the blocks (JᵀJ for amd, metis and nesdis, J
/// itself for colamd) and postordered, so that columns which belong together lie side by side.
/// `method`: amd, metis, nesdis, colamd or natural. Throws `Error` (usage) if SuiteSparse was built
/// without it.
std::vector<std::int32_t> order_columns(const JacobianStructure& structure,
                                        const std::string& method, cholmod_common& common);

}  // namespace cairn
