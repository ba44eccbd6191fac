// SPDX-License-Identifier: BSD-3-Clause
#include "state_extent.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace cairn {
namespace {

constexpr double kRounded = 1e-6;

}  // namespace

double state_extent(const Graph& graph, const Gauge& gauge, const Values& values) {
  double spread = 0.0, alone = 0.0, squares = 0.0;
  std::vector<int> count;
  std::vector<double> mean;
  for (std::size_t pool = 0; pool < values.pools.size(); ++pool) {
    const VariablePool& variables = graph.variable_pools()[pool];
    const auto numbers = static_cast<std::size_t>(variables.type->ambient_size());
    const auto component = [&](std::size_t slot) {
      return static_cast<std::size_t>(
          gauge.component[static_cast<std::size_t>(variables.variables[slot])]);
    };
    const double* x = values.pools[pool].data();
    const std::size_t slots = variables.variables.size();
    count.assign(static_cast<std::size_t>(gauge.components), 0);
    mean.assign(count.size() * numbers, 0.0);
    for (std::size_t v = 0; v < slots; ++v) ++count[component(v)];
    for (std::size_t v = 0; v < slots; ++v) {
      const std::size_t c = component(v);
      for (std::size_t k = 0; k < numbers; ++k)
        mean[c * numbers + k] += x[v * numbers + k] / count[c];
    }
    for (std::size_t v = 0; v < slots; ++v) {
      const std::size_t c = component(v);
      const bool one_of_many = count[c] > 1;
      for (std::size_t k = 0; k < numbers; ++k) {
        const double number = x[v * numbers + k];
        const double apart = one_of_many ? number - mean[c * numbers + k] : number;
        (one_of_many ? spread : alone) += apart * apart;
        squares += number * number;
      }
    }
  }
  return std::max(std::sqrt(spread > 0.0 ? spread : alone), kRounded * std::sqrt(squares));
}

}  // namespace cairn
