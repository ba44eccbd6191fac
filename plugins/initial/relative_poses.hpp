// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"

namespace cairn::initial {

/// A binary factor between two variables, by index.
struct Link {
  int from;
  int to;
  int factor;  ///< position in the graph
};

/// The relative-pose factors on the variables of one pool, whose orientations have `angles` degrees
/// of freedom: those that measure the whole orientation.
std::vector<Link> relative_links(const Graph& graph, int variable_pool, int angles);

/// Factors that measure a point in the Cartesian frame of a pose of that pool. What a factor
/// measures is found by asking it where a pose at the origin sees the point: where the measurement
/// says.
std::vector<Link> cartesian_links(const Graph& graph, int pose_pool);

/// The information matrix of a factor, n × n.
Eigen::MatrixXd information_matrix(const Graph& graph, int factor);

}  // namespace cairn::initial
