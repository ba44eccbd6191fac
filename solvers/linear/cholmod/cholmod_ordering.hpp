// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <cholmod.h>

#include "cairn/linear/block_matrix.hpp"

namespace cairn {

/// A fill-reducing order of the scalars of a block matrix: order[k] is the scalar that is
/// eliminated k-th. It is computed on the graph of the blocks, which is some ten times smaller than
/// that of the scalars and keeps the scalars of a block together. `method`: amd, csymamd, metis,
/// nesdis or natural. Throws `Error` (usage) if CHOLMOD was built without that method.
std::vector<int> order_scalars(const BlockStructure& structure, const std::string& method,
                               cholmod_common& common);

}  // namespace cairn
