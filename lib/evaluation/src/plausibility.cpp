// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/plausibility.hpp"

#include <cmath>

#include <fmt/core.h>

namespace cairn {

std::int64_t degrees_of_freedom(const Graph& graph, const Gauge& gauge) {
  std::int64_t free = 0;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (!gauge.held[v]) free += graph.type(v).tangent_size();
  }
  return graph.residual_size() - free;
}

bool is_plausible(double chi2, std::int64_t degrees_of_freedom) {
  if (!std::isfinite(chi2)) return false;
  return degrees_of_freedom <= 0 || chi2 <= kImplausibleChi2 * double(degrees_of_freedom);
}

std::string implausible_estimate(const Graph& graph, double chi2) {
  const std::int64_t dof = degrees_of_freedom(graph, resolve_gauge(graph));
  if (is_plausible(chi2, dof)) return {};
  return fmt::format(
      "chi2 is {:.3g} times the {} degrees of freedom: this estimate is hardly the right one. "
      "Either "
      "measurements are wrong (a robust loss such as cauchy limits them), or their information is "
      "too "
      "large or in another order, or this is a local minimum (the initial guess incremental is "
      "thorough, and slow)",
      chi2 / static_cast<double>(dof), dof);
}

}  // namespace cairn
