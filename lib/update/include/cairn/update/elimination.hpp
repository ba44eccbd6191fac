// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What takes the place of variables that leave a graph while their information stays.
struct Elimination {
  std::vector<Factor> priors;  ///< each a `MarginalPrior`, on the variables that stay
  std::vector<int> replaced;   ///< positions of the factors that they stand for, rising
};

/// Marginalises `variables` (by index): the factors on them, linearised at the graph's states with
/// the weights of its loss, become priors on the variables that they share factors with, by the
/// Schur complement H_bb − H_bm H_mm⁻¹ H_mb. The linear system that remains has the solution and
/// the covariance that the whole one has for what stays; the constant that chi2 loses is dropped.
///
/// One prior for each group of factors that share a variable to be eliminated. `held` (by variable)
/// gives those of the removed variables that are constant: they are not eliminated but kept at
/// their state, and so are fixed variables that stay. A prior that was made from constant
/// variables, or from priors, counts as absolute for the gauge (`FactorType::absolute_size`). What
/// the measurements do not determine drops out, be it of the variables that leave or of those that
/// stay.
///
/// Takes time in proportion to the number of factors, and cubic in the size of a group. Throws
/// `Error` (numerical) where a Jacobian is not finite.
CAIRN_API Elimination eliminate(const Graph& graph, std::span<const int> variables,
                                const std::vector<bool>& held);

/// The same where the factors on `variables` are known (positions, rising), which saves looking
/// through the whole graph.
CAIRN_API Elimination eliminate(const Graph& graph, std::span<const int> variables,
                                const std::vector<bool>& held, std::span<const int> factors);

}  // namespace cairn
