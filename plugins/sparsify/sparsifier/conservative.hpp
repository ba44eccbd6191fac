// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "approximation.hpp"

namespace cairn::sparsify {

/// Makes an approximation conservative: Λ̆ ⪯ Λ, so that no direction of the blanket gets a smaller
/// variance than it has. In coordinates in which Λ = I all information is divided by the largest
/// eigenvalue of Λ̆, if that is above 1; then each factor takes back what the others leave it, in
/// turns until nothing is gained: with D = I − Σ_{i≠k} Q_iᵀ W_i Q_i,
///
///     Q_kᵀ W Q_k ⪯ D   if and only if   W ⪯ (Q_k D⁻¹ Q_kᵀ)⁻¹.
///
/// The result is within the constraint and no worse than one scale for all, but not the optimum
/// under it, which `ip:conservative=true` computes.
///
/// Marginalising keeps the order of information matrices, so Λ̆ ⪯ Λ of each blanket makes that of
/// the whole graph conservative, where all are linearised at the same states
/// (`sparsify:resolve=false`); with `sparsify:linearize=local`, up to linearisation.
void make_conservative(Approximation& at);

}  // namespace cairn::sparsify
