// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/runtime/aligned.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Turns a graph and a set of states into the normal equations H δ = g with H = Σ ρ′ JᵀJ and
/// g = −Σ ρ′ Jᵀr (J, r whitened; Ila et al. 2017, eq. 3-4), for the variables that are not
/// constant.
///
/// Everything that depends on the structure alone is computed in the constructor; after that a call
/// only evaluates factors and adds blocks into place. Every sum has a fixed order, whatever the
/// number of threads: results agree to the last bit. The graph must outlive the linearizer and keep
/// its structure; its measurements and loss may change.
class CAIRN_API Linearizer {
 public:
  /// `held`: by variable, whether it is constant (see `resolve_gauge`).
  Linearizer(const Graph& graph, std::vector<bool> held);
  Linearizer(Linearizer&&) noexcept;
  ~Linearizer();

  /// One block per variable that is not constant, in the order of the variables.
  const BlockStructure& structure() const;
  /// The block of a variable, -1 if it is constant; and the inverse.
  int block_of(int variable) const;
  int variable_of(int block) const;

  /// Σ ρ(‖r‖²): chi2 as cairn reports it everywhere, without a factor of ½.
  double chi2(const Values& values);

  /// Fills H (on `structure()`) and g (structure().size() doubles). Returns chi2 at `values`.
  double linearize(const Values& values, BlockMatrix& H, std::span<double> g);

  /// out = retract(values, delta); out may be `values` itself.
  void retract(const Values& values, std::span<const double> delta, Values& out) const;

 private:
  struct Plan;
  std::unique_ptr<Plan> plan_;
};

}  // namespace cairn
