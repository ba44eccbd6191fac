// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "approximation.hpp"
#include "cairn/runtime/enum_names.hpp"

namespace cairn::sparsify {

/// Where an iteration begins (T 4.6.1).
enum class InitialInformation {
  identity,  ///< Ω_k = I, whatever the units
  odb,       ///< off-diagonal blocks (T 4.8), made positive definite
  ffd,       ///< identity, and one cycle of factor descent
  scaled,  ///< s (J_k J_kᵀ)⁻¹, one s for all: the one with which tr Λ̆ = r, as at the minimum
};
constexpr auto enum_names(InitialInformation) {
  return std::to_array<EnumName<InitialInformation>>({{InitialInformation::odb, "odb"},
                                                      {InitialInformation::scaled, "scaled"},
                                                      {InitialInformation::identity, "identity"},
                                                      {InitialInformation::ffd, "ffd"}});
}

/// Sets the approximation there. Throws `Error` (numerical) if the factors do not determine all
/// coordinates.
void begin(const RecoveryProblem& problem, InitialInformation initial, Approximation& at);

}  // namespace cairn::sparsify
