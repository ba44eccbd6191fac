// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/types/domain.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/loss.hpp"
#include "cairn/types/never_throws.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

Domain::~Domain() = default;
LieGroup::~LieGroup() = default;
Placement::~Placement() = default;
VariableType::~VariableType() = default;
FactorType::~FactorType() = default;
Loss::~Loss() = default;
NeverThrows::~NeverThrows() = default;

}  // namespace cairn
