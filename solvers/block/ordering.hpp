// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/block_matrix.hpp"

namespace cairn::block {

/// Names that `order` takes: amd (approximate minimum degree), metis (nested dissection; where the
/// library was built with METIS), natural.
const std::vector<std::string>& ordering_names();

/// A fill-reducing ordering of the block graph: element k is the block eliminated k-th. Throws
/// `Error` (usage) for a name that it does not know.
std::vector<std::int32_t> order(const BlockStructure& structure, std::string_view name);

}  // namespace cairn::block
