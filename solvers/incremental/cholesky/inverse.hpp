// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>

#include "system.hpp"
#include "tree.hpp"

namespace cairn::incremental {

/// Every diagonal block of Σ = H⁻¹, by the recursion over supernodes of `block::SelectedInverse`,
/// on a tree whose update matrices are still needed. visit(v, block, stride): a block of size_v ×
/// size_v, column-major with that stride, good until visit returns.
void diagonal_of_inverse(
    const System& system, const Tree& tree,
    const std::function<void(std::int32_t, const double*, std::int64_t)>& visit);

}  // namespace cairn::incremental
