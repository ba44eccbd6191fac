// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// By variable, the positions of the factors on it, rising: of a graph as it was when this was
/// made.
class CAIRN_API FactorsByVariable {
 public:
  FactorsByVariable() = default;
  explicit FactorsByVariable(const Graph& graph);
  std::span<const int> operator[](int variable) const {
    const auto v = static_cast<std::size_t>(variable);
    return {factors_.data() + begin_[v], begin_[v + 1] - begin_[v]};
  }

 private:
  std::vector<std::size_t> begin_;  // in `factors_`, by variable
  std::vector<int> factors_;
};

}  // namespace cairn
