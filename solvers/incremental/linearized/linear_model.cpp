// SPDX-License-Identifier: BSD-3-Clause
#include "linear_model.hpp"

#include <algorithm>

namespace cairn::linearized {

GaussianForm::~GaussianForm() = default;

void Offsets::add(Id id, int size) {
  place_.emplace(id, size_);
  order_.emplace_back(size_, id);
  size_ += size;
}

Id Offsets::variable(int scalar) const {
  const auto after = std::ranges::upper_bound(order_, scalar, {}, &std::pair<int, Id>::first);
  return std::prev(after)->second;
}

}  // namespace cairn::linearized
