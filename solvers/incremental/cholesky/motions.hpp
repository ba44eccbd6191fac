// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "states.hpp"
#include "system.hpp"
#include "tree.hpp"

namespace cairn::incremental {

/// Rigid motions of whole subtrees, which are recorded at their roots (`Node::lead`) and applied to
/// the states below when these are asked for.
class Motions {
 public:
  /// A variable of a separator has a further step as seen from a subtree that has moved as a whole:
  /// what is deferred there is counted from where the motion has brought it.
  struct Turn {
    std::int32_t node, variable;
    std::size_t step;  ///< where in `turned_steps`
  };
  /// Those of the last solution.
  std::span<const Turn> turns() const { return turns_; }
  std::span<const double> turned_steps() const { return turned_steps_; }
  void forget_turns() {
    turns_.clear();
    turned_steps_.clear();
  }

  /// Takes the motion of the separator as a whole out of what is deferred at a node, if no more
  /// than `tolerance` is then left, weighted with the diagonal of H.
  bool move(const System& system, Tree& tree, States& states, Node& node, double tolerance);
  /// Moves a node's own variables by what its subtree is to be moved by, and leaves the rest of it
  /// to its children.
  void hand_down(Tree& tree, States& states, Node& node);

  /// Applies what the nodes above a variable are to be moved by to their states: x_v is then right.
  void settle(Tree& tree, States& states, std::int32_t variable);
  void settle_all(Tree& tree, States& states);
  /// Whether anything of that is to be applied to x_v, and if so x_v as it would be, in `x`.
  bool read(const Tree& tree, const States& states, std::int32_t variable, double* x) const;
  /// Undoes what was noted for a node (see `States::undo`).
  void undo(Tree& tree, std::int32_t node, std::span<const double> lead) {
    tree.node(node).lead.assign(lead.begin(), lead.end());
    ++leads_;
  }

 private:
  void add(Tree& tree, States& states, Node& node, const std::vector<double>& lead);

  std::int64_t leads_ = 0;  // so many motions have been noted
  std::vector<Turn> turns_;
  std::vector<double> turned_steps_;
  std::vector<double> rigid_, matrix_, lead_;
  std::vector<std::int32_t> path_;
};

/// The leads of some nodes.
using Leads = std::unordered_map<std::int32_t, std::vector<double>>;
/// All states, as `Motions::settle_all` would leave them, with these leads of some nodes instead of
/// theirs.
Estimate settled(const Tree& tree, const States& states, Estimate estimate, const Leads& leads);
inline Estimate settled(const Tree& tree, const States& states) {
  return settled(tree, states, states.estimate(), {});
}

}  // namespace cairn::incremental
