// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"

// (T n) is equation or section n of the thesis that sparsification.hpp names.

namespace cairn {

/// Which node a factor is redirected to once its own has left, and how the relative pose of the two
/// is known.
struct RedirectionRule {
  enum class To {
    path,   ///< that to which the path of relative factors is the most certain; their covariances
            ///< are added to the factor's
    place,  ///< the nearest in space; the relative pose is treated as exact, here and below
    order,  ///< the nearest by id
    next,   ///< the next by id, or the last where none follows
  };
  To to = To::path;
  bool newer = false;  ///< `place`, `order`: of two that are equally near the newer one
  /// `path`: what the covariance of the path is multiplied by. Its error is the same in all factors
  /// that are redirected along it, and they count it as if each had one of its own.
  double inflation = 2.0;
};

/// Where removed nodes were, for later factors on them: such a factor is redirected to a node that
/// stays (T 4.6.4), by the relative pose of the two when the node was removed. With `To::path` that
/// is a measurement as well, along a path of the graph's relative factors: they are composed to
/// first order (`MotionGroup::compose`), and a path is as uncertain as the sum of det(Σ)^(1/n) over
/// its factors says. The mean is that of the estimate.
class CAIRN_API Redirection {
 public:
  explicit Redirection(RedirectionRule rule = {}) : rule_(rule) {}

  /// These nodes of `graph` (by index) are about to leave it. Each, and each that had been
  /// redirected to one of them, goes to a pose of its type that stays; to one of `others`, which
  /// may leave later, only where there is no other (that a path leads to).
  void leave(const Graph& graph, std::span<const int> nodes, std::span<const int> others = {});
  bool has(Id node) const { return at_.contains(node); }
  /// Where a node that left would be now: the pose that it goes to, and its state from there.
  Id anchor(Id node) const { return at_.at(node).anchor; }
  std::vector<double> state(Id node, std::span<const double> anchor) const;
  /// Whether there was no pose that a node could be redirected to; it has neither anchor nor state.
  bool lost(Id node) const { return at_.at(node).lost; }
  /// The factor, on nodes that are there. None if that is not defined: it is not relative, its
  /// information is not definite, both its ends have become one node, or no pose was left.
  std::optional<Factor> redirect(const Factor& factor) const;

 private:
  struct Place {
    std::shared_ptr<const VariableType> type;
    Id anchor = 0;
    bool lost = false;  ///< there was no node to redirect to
    Motion motion;      ///< from the anchor
  };
  RedirectionRule rule_;
  std::unordered_map<Id, Place> at_;
};

}  // namespace cairn
