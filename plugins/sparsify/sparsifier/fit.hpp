// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "approximation.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/sparsification/blanket.hpp"
#include "cairn/sparsification/recovery.hpp"

namespace cairn::sparsify {

/// Which covariance Σ of the blanket the information of new factors is fitted to.
enum class Fit {
  blanket,  ///< that of the cropped problem alone (T 4.2)
  scaled,   ///< the same, then all of it times one factor, with which the expected error of the
            ///< whole graph is what its information says
  graph,    ///< that in the whole graph, in which the rest of the graph stays
};
constexpr auto enum_names(Fit) {
  return std::to_array<EnumName<Fit>>(
      {{Fit::blanket, "blanket"}, {Fit::scaled, "scaled"}, {Fit::graph, "graph"}});
}

/// Joint covariance of variables (by index), d × d, in a graph whose marginals are factorised; zero
/// for those that are constant.
Matrix joint_covariance(const Graph& graph, GraphMarginals& marginals,
                        std::span<const int> variables);

/// Covariance S of what Λ of a blanket is about, r × r: the whole where it is absolute, and
/// otherwise all nodes relative to the first one. With Λ (I, X) = 0, X = −Λ_rr⁻¹ Λ_r0, that is
/// (−X, I) Σ (−X, I)ᵀ of the joint covariance Σ, d × d, and Λ_rr its information by the blanket
/// alone. Nothing where either is singular, as where Λ leaves more open or nodes are constant.
std::optional<Matrix> own_covariance(const DenseBlanket& blanket, const Matrix& joint);

/// s with tr s Λ̆ Σ = tr Λ Σ, Σ being the covariance of the blanket in the whole graph (as `S` of
/// `own_covariance`) and Λ̆ the information Ω_k of the factors chosen, m × m each. With it the
/// squared error of the graph, δᵀ (Λ_rest + s Λ̆) δ in its new information, is as large in
/// expectation as it was, one for each degree of freedom: tr (Λ_rest + s Λ̆) Σ = tr (Λ_rest + Λ) Σ.
double certainty_scale(const DenseBlanket& blanket, std::span<const FactorChoice> topology,
                       const std::vector<std::vector<double>>& information, const Matrix& S);

/// Multiplies the information of all factors by s > 0, and makes `kld` and `gradient` those of the
/// factors as they are then: Λ̆ → s Λ̆ in the r coordinates of the problem, whose background is zero,
/// so that KLD = ½ (tr Λ̆ − ln |Λ̆| − r) grows by ½ ((s − 1) tr Λ̆ − r ln s).
void scale(const RecoveryProblem& problem, double s, RecoveryResult& result);

/// The same blanket with S⁻¹ (as `S` of `own_covariance`), in place of its own information.
DenseBlanket within_graph(DenseBlanket blanket, const Matrix& S);

/// R = Tᵀ (Λ_whole − Λ) T ⪰ 0, r × r: what the rest of the graph knows of a blanket, in coordinates
/// in which Λ_whole = `within_graph` is the identity.
std::vector<double> background(const DenseBlanket& whole, const DenseBlanket& blanket,
                               const BlanketProjection& projection);

}  // namespace cairn::sparsify
