// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

// (T n) is equation or section n of the thesis that sparsification.hpp names.

namespace cairn {

/// Where the two graphs are linearised for their divergence.
enum class ComparedAt {
  /// Both at the states of the original graph: independent of coordinates, and what the sparse
  /// graph has lost; zero where it has lost nothing.
  common,
  /// Each at its own states, in world coordinates, as (T 4.6.4). Where headings differ between the
  /// two minima, this charges for uncertainties that merely have turned.
  minima,
};

/// The divergence of a sparse graph from the original.
struct SparsificationError {
  double kld = 0.0;           ///< D(original ‖ sparse) of the nodes of both [nats] (T 3.4)
  double covariance = 0.0;    ///< of that, the part of the covariances
  double mean = 0.0;          ///< and that of the means: ½ (μ̆ − μ)ᵀ Λ̆ (μ̆ − μ)
  double rmse = 0.0;          ///< of positions [m]; NaN without positions
  double rmse_aligned = 0.0;  ///< the same after a rigid motion of the sparse graph [m]

  CAIRN_API static ResultFields<SparsificationError> fields();
};

/// D(p‖q) = ½ (tr(Λ̆Σ) − ln |Λ̆Σ| + ‖μ̆ − μ‖²_Λ̆ − d), p the marginal of `original` on the nodes of
/// `sparse`, q `sparse`; the states of both should be minima. Of p only the blocks of Σ on the
/// pattern of Λ̆ are computed, so it works on many thousands of nodes. Nodes that are constant in
/// one graph must be constant in the other; where the gauge is free, the first node of `sparse` is,
/// and `sparse` is moved so that this node is where it is in `original`. `solver`
/// must have the abilities `LogDeterminant` and `Marginals` (`block_cholesky` has). Throws `Error`
/// (input) if `sparse` has a node that `original` has not, or one that is constant in only one of
/// the two, (numerical) where H is singular.
CAIRN_API SparsificationError sparsification_error(const Graph& original, const Graph& sparse,
                                                   LinearSolver& solver,
                                                   ComparedAt at = ComparedAt::common);

/// The smallest eigenvalue of Λ − Λ̆: Λ the information of the marginal of `original` on the nodes
/// of `sparse`, Λ̆ that of `sparse`, both at the states of `original` [1/m², 1/rad²]. Where it is
/// not negative, `sparse` is conservative: no direction has a smaller variance than in `original`.
/// Otherwise it is how much information some direction is claimed to have that it has not, per unit
/// of its length. By Lanczos' method on the inverse of the shifted matrix, in the sparse form that
/// has it as a Schur complement; rounding is about 1e-12 of the largest information. `solver` must
/// be a direct one. Throws as `sparsification_error` does.
CAIRN_API double conservative_margin(const Graph& original, const Graph& sparse,
                                     LinearSolver& solver);

/// `sparsification_error` of graphs that both have nodes which the other lacks: D(p‖q) of their
/// marginals on `nodes`, which both have; `common` linearises at the states of `p` as far as it has
/// them. By the dense joint covariances of these nodes, of at most `kMostDenseSize` coordinates; of
/// more it throws `Error` (input).
CAIRN_API SparsificationError marginal_divergence(const Graph& p, const Graph& q,
                                                  std::span<const Id> nodes, LinearSolver& solver,
                                                  ComparedAt at = ComparedAt::common);
inline constexpr int kMostDenseSize = 6000;

}  // namespace cairn
