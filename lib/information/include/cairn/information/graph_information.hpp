// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/api.hpp"

// Information measures [nats] of the Gaussian N(x, H⁻¹) that a graph is at its states x: of the
// whole, and of sets of variables by their joint marginal covariance. They are those of the
// estimate if x is a minimum and the factors' information is true.
//
// Constant variables (fixed, or anchored for the gauge) have no coordinates: they add nothing to an
// entropy, and share no information. What is measured is relative to them, so that entropy and
// mutual information depend on which variables are constant; entropy also on units (gaussian.hpp).

namespace cairn {

struct GraphEntropy {
  std::int64_t size = 0;         ///< coordinates: scalar unknowns of the graph
  double log_determinant = 0.0;  ///< ln |H|
  double entropy = 0.0;          ///< ½ (size ln 2πe − ln |H|) [nats] (T 3.2)
};

/// Of all variables, linearised at the graph's states: one factorisation and, where the solver has
/// the ability `Marginals`, the block diagonal of Σ, which shows whether H is singular to
/// rounding. Throws `Error` (usage) if the solver lacks the ability `LogDeterminant`, (numerical)
/// where H is singular, with the reason.
CAIRN_API GraphEntropy entropy(const Graph& graph, LinearSolver& solver);

// Of some of the variables, by number. `marginals` are those of the graph, after `factorize`; a set
// of d coordinates takes d² numbers and d³ operations besides the blocks of Σ. Throws `Error`
// (usage) if a variable is named twice, (numerical) if a covariance is not positive definite.

/// Σ of these variables, in their order and without the constant ones.
CAIRN_API Eigen::MatrixXd joint_covariance(const Graph& graph, GraphMarginals& marginals,
                                           std::span<const int> variables);
CAIRN_API double entropy(const Graph& graph, GraphMarginals& marginals,
                         std::span<const int> variables);
/// H(a|b): of `a`, once `b` is known.
CAIRN_API double conditional_entropy(const Graph& graph, GraphMarginals& marginals,
                                     std::span<const int> a, std::span<const int> b);

/// Two sets of variables without a common one.
struct VariableSets {
  std::vector<int> a, b;
};
/// I(a; b) of each pair of sets, as `mutual_information` of their joint covariance. All blocks of Σ
/// are computed together, which takes a fraction of the time of one call each.
CAIRN_API std::vector<double> mutual_information(const Graph& graph, GraphMarginals& marginals,
                                                 std::span<const VariableSets> sets);

}  // namespace cairn
