// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/types/loss_by_size.hpp"

#include <algorithm>

namespace cairn {

std::shared_ptr<const Loss> for_size(std::shared_ptr<const Loss> loss, int size) {
  if (!loss) return loss;
  // Abilities are asked of components that may be changed; this one changes nothing.
  const auto* by_size = query<LossBySize>(const_cast<Loss&>(*loss));
  return by_size ? by_size->for_size(std::max(size, 1)) : loss;
}

}  // namespace cairn
