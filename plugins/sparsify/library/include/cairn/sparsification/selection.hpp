// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/sparsification/sparsifier.hpp"

namespace cairn {

/// Chooses which nodes are removed.
class CAIRN_API NodeSelection : public Component {
 public:
  static constexpr std::string_view kKind = "node_selection";
  ~NodeSelection() override;

  /// Nodes by index, in the order in which they are to be removed; `nodes` are those that may be
  /// removed, rising. `sparsifier` computes what that would cost, and can be tried on a copy.
  virtual std::vector<int> select(const Graph& graph, std::span<const int> nodes,
                                  Sparsifier& sparsifier) = 0;
  /// The same, but `count` nodes at most, whatever the selection's own rule of how many: for a map
  /// whose size is bounded. By default the first of `select`.
  virtual std::vector<int> choose(const Graph& graph, std::span<const int> nodes,
                                  Sparsifier& sparsifier, int count);
};

}  // namespace cairn
