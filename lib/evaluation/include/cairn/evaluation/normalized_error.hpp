// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn {

/// Whether an estimate is consistent with its covariance.
struct NormalizedError {
  double squared = 0.0;  ///< eᵀ Σ⁻¹ e
  int dof = 0;           ///< its mean if the covariance is right

  CAIRN_API static ResultFields<NormalizedError> fields();
};

/// The normalised estimation error squared (NEES) of a graph's poses and landmarks against their
/// true states, all of them together: eᵀ H e with e_v = local(x_v, truth_v), and H of the factors
/// at the estimate, under its loss (Σ = H⁻¹). The truth is moved so that the first pose agrees,
/// which is constant, as are those that are fixed. Variables are matched by id. A mean over many
/// runs above `dof` means that the estimate is overconfident, below that it is conservative. Throws
/// `Error` (input) if a variable has no true state, (usage) if it is neither a landmark
/// (`is_point`) nor a pose of the first variable's type, a Lie group.
CAIRN_API NormalizedError normalized_error(const Graph& estimate, const Graph& truth);

/// The absolute trajectory error predicted by an estimate's covariance [m]: the root mean square of
/// the position errors of some poses, after rigid alignment, to first order: E² = tr((I − P) Σ_p) /
/// n with Σ_p the joint covariance of their positions in the world and P the projector on what a
/// rigid motion does to them. Takes a column of Σ for each of the poses. Throws `Error` (usage) for
/// variables without `Placement`.
CAIRN_API double expected_ate(Estimator& estimator, const Graph& graph, std::span<const Id> poses);

/// At most 40 of these ids, spread evenly over them and the last among them: enough for
/// `expected_ate` of a whole trajectory.
CAIRN_API std::vector<Id> evenly_spread(std::span<const Id> ids);

}  // namespace cairn
