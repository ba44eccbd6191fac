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
  // Squares of distances: from the mean of a component, from that of all, from the origin.
  double within = 0.0, among = 0.0, squares = 0.0;
  const auto groups = static_cast<std::size_t>(gauge.components) + 1;  // the last has all
  std::vector<int> count;
  std::vector<double> mean;
  for (std::size_t pool = 0; pool < values.pools.size(); ++pool) {
    const VariablePool& variables = graph.variable_pools()[pool];
    const auto numbers = static_cast<std::size_t>(variables.type->ambient_size());
    const std::size_t slots = variables.variables.size();
    const auto component = [&](std::size_t slot) {
      return static_cast<std::size_t>(
          gauge.component[static_cast<std::size_t>(variables.variables[slot])]);
    };
    const double* x = values.pools[pool].data();
    count.assign(groups, 0);
    mean.assign(groups * numbers, 0.0);
    for (std::size_t v = 0; v < slots; ++v) ++count[component(v)];
    count.back() = static_cast<int>(slots);
    for (std::size_t v = 0; v < slots; ++v) {
      for (const std::size_t group : {component(v), groups - 1}) {
        for (std::size_t k = 0; k < numbers; ++k)
          mean[group * numbers + k] += x[v * numbers + k] / count[group];
      }
    }
    for (std::size_t v = 0; v < slots; ++v) {
      for (std::size_t k = 0; k < numbers; ++k) {
        const double number = x[v * numbers + k];
        const double in_component = number - mean[component(v) * numbers + k];
        const double in_pool = number - mean[(groups - 1) * numbers + k];
        within += in_component * in_component;
        among += in_pool * in_pool;
        squares += number * number;
      }
    }
  }
  const double spread = within > 0.0 ? within : among > 0.0 ? among : squares;
  return std::max(std::sqrt(spread), kRounded * std::sqrt(squares));
}

}  // namespace cairn
