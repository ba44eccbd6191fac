// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"

namespace cairn {

/// Which variables are constant in an optimisation, so that H is not singular by construction.
///
/// Variables marked `FIX` are fixed. A connected component that has none, and whose priors (mostly
/// factors on one variable: `FactorType::absolute_size`) together measure fewer numbers than a pose
/// has degrees of freedom, gets its first pose anchored: the first variable with the component's
/// largest tangent space, if its states form a Lie group. The gauge freedom of the component moves
/// that pose anywhere, so anchoring it does not change the minimum. A variable that is not a group
/// element, such as a camera whose focal length is unknown, is more than a pose: anchoring it would
/// make constant what the measurements determine, so its component is left free, and damped
/// optimizers still converge. Anchors are not written to files.
struct CAIRN_API Gauge {
  std::vector<bool> held;      ///< by variable
  std::vector<int> anchored;   ///< variables made constant only to fix the gauge, one per component
  std::vector<int> left_free;  ///< one of each component whose gauge stays free in part
  std::vector<int> component;  ///< by variable: its connected component, 0 … components-1
  int components = 0;
  int components_with_fixed = 0;
  std::vector<int> unconstrained;  ///< variables without any factor (constant too)

  /// One or two sentences for a summary, such as
  /// "no variable is fixed: anchored VERTEX_SE2 0".
  std::string describe(const Graph& graph) const;
};

CAIRN_API Gauge resolve_gauge(const Graph& graph);

}  // namespace cairn
