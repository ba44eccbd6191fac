// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/types/loss.hpp"

namespace cairn::initial {

/// Losses by which a graph is optimised on the way to a minimum of its own chi2: they level what
/// separates one minimum from another. Each ρ(s) of s = ‖r‖².

/// q ln(1 + s/q): limits what is wrong, and still pulls at it.
std::shared_ptr<const Loss> make_cauchy(double q = 2.3849 * 2.3849);  // as `cauchy` by default
/// s / (1 + s/q): what is wrong no longer counts.
std::shared_ptr<const Loss> make_geman_mcclure(double q);
/// w s: as if the information were w times what it is.
std::shared_ptr<const Loss> make_weight(double w);

/// A loss at k times its scale, k² ρ(s/k²). Graduated non-convexity (Blake and Zisserman, "Visual
/// reconstruction", 1987; Yang et al., RA-L 2020) begins at a scale at which all measurements
/// count, and tightens it.
std::shared_ptr<const Loss> make_wider(std::shared_ptr<const Loss> loss, double k);

/// Whether ρ does not grow beyond some residual: chi2 is then hardly larger where all loop closures
/// are wrong, so that it hardly depends on the start.
bool is_bounded(const Loss& loss);
/// Whether a graph has such a loss.
bool has_bounded_losses(const Graph& graph);

/// What losses the factors have, put back when this ends.
class KeptLosses {
 public:
  explicit KeptLosses(Graph& graph);
  KeptLosses(const KeptLosses&) = delete;
  KeptLosses& operator=(const KeptLosses&) = delete;
  ~KeptLosses() { put_back(); }

  void put_back();
  /// By factor; null: none.
  const std::vector<std::shared_ptr<const Loss>>& losses() const { return losses_; }

 private:
  Graph& graph_;
  std::vector<std::shared_ptr<const Loss>> losses_;
};

/// Gives each factor that has a bounded loss `instead` of it, and the others their own.
void set_instead_of_bounded(
    Graph& graph, const KeptLosses& losses,
    const std::function<std::shared_ptr<const Loss>(std::shared_ptr<const Loss>)>& instead);

}  // namespace cairn::initial
