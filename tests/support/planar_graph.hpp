// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "cairn/graph/graph.hpp"

namespace cairn::test {

/// Types by which tests of the core stand without any plugin: poses and points in the plane, and
/// factors that are differentiated automatically. Those of two objects are not the same.
struct PlanarTypes {
  PlanarTypes();

  std::shared_ptr<const VariableType> pose, point;       ///< VERTEX_SE2, VERTEX_XY
  std::shared_ptr<const FactorType> relative_pose;       ///< EDGE_SE2; leads from pose to pose
  std::shared_ptr<const FactorType> prior, point_prior;  ///< EDGE_PRIOR_SE2, EDGE_PRIOR_XY
  std::shared_ptr<const FactorType> point_seen;          ///< EDGE_SE2_XY; a point seen from a pose
};

/// A random graph of `poses` poses in a chain with loops, and points seen from them. Measurements
/// do not agree with each other, so that no residual is zero.
Graph random_graph(const PlanarTypes& types, int poses, int points, unsigned seed);

}  // namespace cairn::test
