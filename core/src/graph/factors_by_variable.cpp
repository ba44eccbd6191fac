// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/graph/factors_by_variable.hpp"

#include <cstdint>

namespace cairn {

FactorsByVariable::FactorsByVariable(const Graph& graph)
    : begin_(static_cast<std::size_t>(graph.variable_count()) + 1, 0) {
  for (int f = 0; f < graph.factor_count(); ++f) {
    for (const std::int32_t v : graph.factor_variables(f)) ++begin_[v + 1];
  }
  for (std::size_t v = 1; v < begin_.size(); ++v) begin_[v] += begin_[v - 1];
  factors_.resize(begin_.back());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  for (int f = 0; f < graph.factor_count(); ++f) {
    for (const std::int32_t v : graph.factor_variables(f)) factors_[next[v]++] = f;
  }
}

}  // namespace cairn
