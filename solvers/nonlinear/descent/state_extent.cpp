// SPDX-License-Identifier: BSD-3-Clause
#include "state_extent.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace cairn {
namespace {

constexpr double kRounded = 1e-6;

/// The means of the states of a pool, number by number, in each group of its slots.
template <class GroupOf>
std::vector<double> means(std::span<const double> x, std::size_t numbers, std::size_t groups,
                          const GroupOf& group_of) {
  std::vector<double> mean(groups * numbers, 0.0);
  std::vector<double> count(groups, 0.0);
  for (std::size_t begin = 0, slot = 0; begin < x.size(); begin += numbers, ++slot) {
    const std::size_t group = group_of(slot);
    count[group] += 1.0;
    for (std::size_t k = 0; k < numbers; ++k) mean[group * numbers + k] += x[begin + k];
  }
  for (std::size_t i = 0; i < mean.size(); ++i) mean[i] /= std::max(count[i / numbers], 1.0);
  return mean;
}

/// Σ of the squared distances of the states from these means.
template <class GroupOf>
double squares_about(std::span<const double> x, std::size_t numbers, std::span<const double> mean,
                     const GroupOf& group_of) {
  double sum = 0.0;
  for (std::size_t begin = 0, slot = 0; begin < x.size(); begin += numbers, ++slot) {
    const double* of_group = mean.data() + group_of(slot) * numbers;
    for (std::size_t k = 0; k < numbers; ++k) {
      const double distance = x[begin + k] - of_group[k];
      sum += distance * distance;
    }
  }
  return sum;
}

}  // namespace

double state_extent(const Graph& graph, const Gauge& gauge, const Values& values) {
  // Squares of distances: from the mean of a component, from that of all, from the origin.
  double within = 0.0, among = 0.0, squares = 0.0;
  const auto together = [](std::size_t) { return std::size_t{0}; };
  for (std::size_t pool = 0; pool < values.pools.size(); ++pool) {
    const VariablePool& variables = graph.variable_pools()[pool];
    const auto numbers = static_cast<std::size_t>(variables.type->ambient_size());
    const std::span<const double> x = values.pools[pool];
    const auto component = [&](std::size_t slot) {
      return static_cast<std::size_t>(
          gauge.component[static_cast<std::size_t>(variables.variables[slot])]);
    };
    const double about_all = squares_about(x, numbers, means(x, numbers, 1, together), together);
    among += about_all;
    if (gauge.components == 1) {
      within += about_all;
    } else {
      const auto groups = static_cast<std::size_t>(gauge.components);
      within += squares_about(x, numbers, means(x, numbers, groups, component), component);
    }
    for (const double number : x) squares += number * number;
  }
  const double spread = within > 0.0 ? within : among > 0.0 ? among : squares;
  return std::max(std::sqrt(spread), kRounded * std::sqrt(squares));
}

}  // namespace cairn
