// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/pose_remover.hpp"

namespace cairn {

PoseRemover::~PoseRemover() = default;

void PoseRemover::Removal::add_to(GraphUpdate& other) const {
  const auto insert = [](auto& into, const auto& what) {
    into.insert(into.begin(), what.begin(), what.end());
  };
  insert(other.factors, update.factors);
  insert(other.removed_factors, update.removed_factors);
  insert(other.removed_variables, update.removed_variables);
}

}  // namespace cairn
