// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string_view>

#include "cairn/runtime/api.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {

/// Ability of a loss whose scale follows from the size of the residual: the norm of a right
/// residual of six numbers is larger than that of one. A graph asks for it when a factor gets its
/// loss.
class CAIRN_API LossBySize {
 public:
  static constexpr std::string_view kAbility = "loss_by_size";

  /// The loss for residuals of that many measured numbers, at least one, with its scale fixed. The
  /// same object for the same size, in any thread.
  virtual std::shared_ptr<const Loss> for_size(int size) const = 0;

 protected:
  ~LossBySize() = default;
};

/// What a factor gets that measures that many numbers (the rank of its information; below one
/// counts as one): `loss` itself, unless its scale follows from the size. Null stays null.
CAIRN_API std::shared_ptr<const Loss> for_size(std::shared_ptr<const Loss> loss, int size);

}  // namespace cairn
