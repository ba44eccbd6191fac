// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"

namespace cairn::conformance {

/// Types of planar poses and relative poses, by default of this library's own, which need no
/// plugin.
struct PlanarTypes {
  std::shared_ptr<const VariableType> pose;
  std::shared_ptr<const FactorType> relative_pose;
};
PlanarTypes own_planar_types();

/// A robot that drives twice around a circle: relative poses to the pose before, and from each pose
/// of the second lap to that of the first. Measurements have a standard deviation of 2 cm and
/// 0.01 rad, and the initial estimate is composed of the odometry.
Graph two_laps(int poses, std::uint64_t seed, const PlanarTypes& types = own_planar_types());

/// ρ(s) = ln(1 + s).
std::shared_ptr<const Loss> own_loss();

std::string described(const Graph& graph);

/// The numbers of all states, in the order of the variables.
std::vector<double> states_of(const Graph& graph);
bool all_finite(const Graph& graph);

/// Moves the graph to the minimum next to its states by Gauss-Newton with dense algebra, which no
/// plugin is part of; chi2 there.
double minimize_densely(Graph& graph);

/// H⁻¹ of the whole graph at its states with the gauge fixed, and the first row of each variable in
/// it (−1: constant).
struct DenseCovariance {
  Eigen::MatrixXd Sigma;
  std::vector<std::int64_t> first;
};
DenseCovariance dense_covariance(const Graph& graph);

}  // namespace cairn::conformance
