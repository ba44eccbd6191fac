// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "cairn/geometry/linear_constraint.hpp"
#include "local_problem.hpp"

namespace cairn::sparsify {

/// The types of linear constraints: one for all of a rank on the same kinds of nodes, so that a
/// graph has them in few pools.
class LinearConstraints {
 public:
  std::shared_ptr<const LinearConstraint> type(const LinearConstraint::Nodes& nodes, int rank);

 private:
  std::vector<std::shared_ptr<const LinearConstraint>> types_;
};

/// Adds the model on all nodes of a blanket, whose states, Λ and gradient g are known. With S the
/// Jacobian of the constraint's coordinates e and TᵀΛT = I its residual is G e − b,
///
///     G = TᵀΛS⁻¹,   GᵀG = S⁻ᵀΛS⁻¹,   b = Tᵀg
///
/// (Carlevaris-Bianco, Kaess and Eustice, T-RO 2014, where G is of Λ's eigenvectors; T is that of
/// `project`, which is as good a root, and G has as many rows as Λ has rank). What S leaves out,
/// the pose of the whole where the blanket is relative, Λ leaves open. So with the identity as its
/// information nothing is lost, wherever the blanket has been linearised.
void add_constraint_model(const Graph& graph, const LocalProblem& local, LinearConstraints& types,
                          Marginal& marginal);

}  // namespace cairn::sparsify
