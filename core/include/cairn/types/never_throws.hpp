// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Ability of a factor type or a loss: what it computes of good numbers never throws. Of graphs
/// where everything has it, estimators keep nothing that would undo an update half-way.
///
/// A struct given to `define_factor` gets it where its functions are `noexcept`.
class CAIRN_API NeverThrows {
 public:
  virtual ~NeverThrows();
};

}  // namespace cairn
