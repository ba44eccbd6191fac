// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "cairn/sparsification/linear_constraint.hpp"
#include "local_problem.hpp"

namespace cairn::sparsify {

/// The types of linear constraints: one for all on the same kinds of nodes, so that a graph has
/// them in few pools.
class LinearConstraints {
 public:
  std::shared_ptr<const LinearConstraint> type(const LinearConstraint::Nodes& nodes);

 private:
  std::vector<std::shared_ptr<const LinearConstraint>> types_;
};

/// Adds the model on all nodes of a blanket, whose states, Λ and gradient are known. With S the
/// Jacobian of the constraint's coordinates e and TᵀΛT = I its residual is G e,
///
///     G = TᵀΛS⁻¹,   GᵀG = S⁻ᵀΛS⁻¹
///
/// (Carlevaris-Bianco, Kaess and Eustice, T-RO 2014, where G is of Λ's eigenvectors; T is that of
/// `project`, which is as good a root, and G has as many rows as Λ has rank). What S leaves out,
/// the pose of the whole where the blanket is relative, Λ leaves open. So the optimum of its
/// information is the identity, and nothing is lost. The mean is ē = S T Tᵀ g, zero at the
/// blanket's own minimum.
void add_linear_model(const Graph& graph, const LocalProblem& local, LinearConstraints& types,
                      Marginal& marginal);

}  // namespace cairn::sparsify
