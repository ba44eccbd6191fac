// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/geometry/loop_closures.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

/// Which loop closures stay.
struct EdgeChoice {
  std::vector<int> stay{};  ///< of the candidates, by position, rising
  bool complete = true;     ///< false: interrupted, and nothing is chosen
  /// No choice of as many has an algebraic connectivity above this, by edges of that weight; none:
  /// not known.
  std::optional<double> connectivity_bound{};
  EdgeWeight connectivity_weight = EdgeWeight::rotation;
  /// No choice of as many has a divergence below this, of the covariances [nats]; none: not known.
  std::optional<double> kld_bound{};
  std::vector<std::string> notes{};
};

/// Chooses which loop closures of a graph stay, where all variables do.
class CAIRN_API EdgeSelection : public Component {
 public:
  static constexpr std::string_view kKind = "edge_selection";
  ~EdgeSelection() override;

  /// Is called with how much is done of how much, and returns whether to go on.
  using Step = std::function<bool(int done, int total)>;

  /// From `candidates`, those of `find_loop_closures`. The graph should be at its minimum, which is
  /// where it is linearised. Throws `Error` (input) for a graph that the method is not defined for.
  virtual EdgeChoice choose(const Graph& graph, std::span<const int> candidates,
                            const Step& step = {}) = 0;
};

}  // namespace cairn
