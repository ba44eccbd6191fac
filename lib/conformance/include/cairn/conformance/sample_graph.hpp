// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn::conformance {

/// Types of planar poses and relative poses, by default of this library's own, which need no
/// plugin.
struct PlanarTypes {
  std::shared_ptr<const VariableType> pose;
  std::shared_ptr<const FactorType> relative_pose;
};
CAIRN_API PlanarTypes own_planar_types();

/// A robot that drives twice around a circle: relative poses to the pose before, and from each pose
/// of the second lap to that of the first. Measurements have a standard deviation of 2 cm and
/// 0.01 rad, and the initial estimate is composed of the odometry.
CAIRN_API Graph two_laps(int poses, std::uint64_t seed,
                         const PlanarTypes& types = own_planar_types());

/// ρ(s) = ln(1 + s).
CAIRN_API std::shared_ptr<const Loss> own_loss();

CAIRN_API std::string described(const Graph& graph);

/// The numbers of all states, in the order of the variables.
CAIRN_API std::vector<double> states_of(const Graph& graph);
CAIRN_API bool all_finite(const Graph& graph);

/// The largest distance of a variable of both planar graphs, in its tangent space; variables that
/// the second has not do not count.
CAIRN_API double largest_distance(const Graph& some, const Graph& all);

/// Moves the graph to the minimum next to its states by Gauss-Newton with dense algebra, which no
/// plugin is part of; chi2 there.
CAIRN_API double minimize_densely(Graph& graph);

/// H⁻¹ of the whole graph at its states with the gauge fixed, and the first row of each variable in
/// it (−1: constant).
struct DenseCovariance {
  Eigen::MatrixXd Sigma;
  std::vector<std::int64_t> first;
};
CAIRN_API DenseCovariance dense_covariance(const Graph& graph);

}  // namespace cairn::conformance
