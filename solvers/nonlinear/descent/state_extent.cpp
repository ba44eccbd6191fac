// SPDX-License-Identifier: BSD-3-Clause
#include "state_extent.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kRounded = 1e-6;

}  // namespace

double state_extent(const Graph& graph, const Values& values) {
  double spread = 0.0, alone = 0.0, squares = 0.0;
  for (std::size_t pool = 0; pool < values.pools.size(); ++pool) {
    const AlignedVector& x = values.pools[pool];
    const auto numbers =
        static_cast<std::size_t>(graph.variable_pools()[pool].type->ambient_size());
    const std::size_t count = graph.variable_pools()[pool].variables.size();
    for (std::size_t c = 0; c < numbers; ++c) {
      double mean = 0.0;
      for (std::size_t v = 0; count > 1 && v < count; ++v)
        mean += x[v * numbers + c] / static_cast<double>(count);
      for (std::size_t v = 0; v < count; ++v) {
        const double number = x[v * numbers + c];
        (count > 1 ? spread : alone) += (number - mean) * (number - mean);
        squares += number * number;
      }
    }
  }
  return std::max(std::sqrt(spread > 0.0 ? spread : alone), kRounded * std::sqrt(squares));
}

}  // namespace cairn
