// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"

// (T n) is equation or section n of the thesis that sparsification.hpp names.

namespace cairn {

/// Positions of removed nodes, for later factors on them: such a factor is redirected to the
/// nearest node that stays (T 4.6.4), by the relative pose of the two when the node was removed,
/// which is treated as exact.
class CAIRN_API Redirection {
 public:
  enum class Nearest {
    place,  ///< in space
    order,  ///< by id, as the thesis's figures suggest that it does
  };
  explicit Redirection(Nearest nearest = Nearest::place) : nearest_(nearest) {}

  /// These nodes of `graph` (by index) are about to leave it. Each, and each that had been
  /// redirected to one of them, goes to the nearest pose of its type that stays; `also` are others
  /// to which nothing is redirected.
  void leave(const Graph& graph, std::span<const int> nodes, std::span<const int> also = {});
  bool has(Id node) const { return at_.contains(node); }
  /// Where a node that left would be now: the pose that it goes to, and its state from there.
  Id anchor(Id node) const { return at_.at(node).anchor; }
  std::vector<double> state(Id node, std::span<const double> anchor) const;
  /// The factor, on nodes that are there. None if that is not defined: it is not relative, or both
  /// its ends have become one node, or no pose was left.
  std::optional<Factor> redirect(const Factor& factor) const;

 private:
  struct Place {
    std::shared_ptr<const VariableType> type;
    Id anchor = 0;
    bool lost = false;           ///< there was no node to redirect to
    std::vector<double> motion;  ///< from the anchor
  };
  Nearest nearest_;
  std::unordered_map<Id, Place> at_;
};

}  // namespace cairn
