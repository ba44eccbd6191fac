// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "block/kernels.hpp"
#include "block/symbolic.hpp"
#include "cairn/runtime/aligned.hpp"
#include "reordering.hpp"
#include "system.hpp"

namespace cairn::incremental {

/// A supernode of the elimination tree: its own variables, which it eliminates, and the variables
/// of its ancestors that they are joined with by then (its separator). Beside its columns of L it
/// keeps its update matrix, all that its subtree contributes to its ancestors: they can be
/// recomputed without reading what is below.
struct Node {
  std::vector<std::int32_t> variables;  ///< own, in the order of elimination, then the separator
  std::int32_t own = 0;                 ///< so many of them are its own
  std::int32_t parent = -1;
  std::vector<std::int32_t> children;
  std::int32_t columns = 0;              ///< scalars of its own variables
  std::int32_t m = 0;                    ///< and of the separator
  std::int32_t stride = 0;               ///< m rounded up to 8
  std::int64_t sequence = 0;             ///< children have smaller ones than their parents
  UninitializedVector panel;             ///< stride × columns
  UninitializedVector update;            ///< as `block::Kernels` lays it out
  std::vector<block::Run> runs;          ///< where the separator is in vectors, and in the front
  std::vector<std::int32_t> rows_above;  ///< where each separator variable is in the parent's front
  std::vector<block::Spread> spreads;    ///< the update matrix's rows in the parent's front, if …
  bool straight = false;                 ///< … both have the separator in the same order
  std::int32_t panel_rows = 0;  ///< if so: rows of the update matrix that are parent's columns
  std::vector<double> owed;     ///< steps of the separator that are deferred: not applied here yet
  bool owes = false;            ///< whether any of them is not zero
  /// Whether this subtree is invariant to rigid motions, except for its separator: all its factors
  /// are relative ones between variables of one group.
  bool movable = false;
  /// The group element by which all of this subtree is still to be moved, and the sum of the
  /// twists of which it is composed.
  std::vector<double> lead;
  std::int64_t settled_at = -1;  ///< nothing above has had a lead since that many (see `Tree`)
  bool live = false;
  bool affected = false;

  std::int32_t below() const { return m - columns; }
  std::int32_t update_stride() const { return stride - columns / 8 * 8; }
  /// Element (i, j) of the update matrix, i ≥ j rows of the front, both ≥ columns.
  std::int64_t update_place(std::int32_t i, std::int32_t j) const {
    return std::int64_t{j - columns} * update_stride() + (i - columns / 8 * 8);
  }
  std::span<const std::int32_t> own_variables() const {
    return std::span(variables).first(static_cast<std::size_t>(own));
  }
  std::span<const std::int32_t> separator() const {
    return std::span(variables).subspan(static_cast<std::size_t>(own));
  }
};

/// The Cholesky factor L of a system that changes, as an elimination tree of supernodes, any upper
/// part of which can be detached, reordered and re-eliminated while the subtrees below it stay.
///
/// The columns of L that a change of H reaches are those of the variables that it touches and of
/// their ancestors: the union of the paths to the roots, an upper part of the tree. `restructure`
/// reorders the variables of that part, including the fill that the subtrees below have already
/// caused among them (IJRR 2017, 3.2 takes all columns to the right instead; see docs/online.md for
/// the difference). `Factorization` computes it from H and the update matrices of the subtrees
/// below, `Substitution` solves with it, and `Motions` are of whole subtrees.
class Tree {
 public:
  explicit Tree(const block::Kernels& kernels) : kernels_(&kernels) {}

  /// The next variable, which is in no node yet.
  void add_variable() { variables_.emplace_back(); }
  /// One factor more (or less) of a variable depends on a rigid motion of everything: a prior, one
  /// to a constant variable, one that is not relative.
  void bind(std::int32_t variable, std::int32_t factors) { variables_[variable].bound += factors; }

  /// Starts a set of affected nodes.
  void clear_affected();
  /// Adds the nodes on the path from a variable to its root; a variable that is in no node yet
  /// becomes a part of the tree at the next `restructure`.
  void touch(std::int32_t variable);
  /// Takes a variable out of the tree at the next `restructure`; it must have been touched, and H
  /// must not join it with anything any more.
  void retire(std::int32_t variable);

  /// The cost of factorising the affected nodes, by the cost model [ns], and what `touch` would add
  /// to it; summed no further than beyond `limit`.
  double affected_cost() const;
  double cost_to_touch(std::int32_t variable, double limit) const;

  /// Reorders the affected variables.
  void restructure(const System& system, const Recency& recency);
  /// Whether the factor has become more costly, since all of it was last ordered, than the growth
  /// of the graph explains.
  bool worn_out() const;
  /// About how long it would take to order and factorise all of it.
  double seconds_to_order_anew() const;

  /// Node of a variable, -1 for none.
  std::int32_t node_of(std::int32_t variable) const { return variables_[variable].node; }
  /// Whether a variable is in the subtree of a node.
  bool below(std::int32_t variable, std::int32_t node) const;
  const std::vector<Node>& nodes() const { return nodes_; }
  /// A node whose numbers, or what is deferred there, are to be changed.
  Node& node(std::int32_t n) { return nodes_[n]; }
  std::int32_t number_of(const Node& node) const {
    return static_cast<std::int32_t>(&node - nodes_.data());
  }
  const block::Kernels& kernels() const { return *kernels_; }
  std::span<const std::int32_t> affected() const { return affected_; }
  void put_affected_children_first();
  int affected_variables() const { return affected_variables_; }
  /// So many nodes were detached with steps or motions still deferred, which are lost: none if
  /// their variables were followed (`Substitution::follow`) before they were touched.
  std::int64_t unsettled() const { return unsettled_; }
  std::int64_t doubles() const { return doubles_; }
  double log_determinant() const;
  /// Nodes with parents before their children.
  void top_down(std::vector<std::int32_t>& nodes) const;

 private:
  struct Variable {
    std::int32_t node = -1;
    std::int32_t bound = 0;
    bool fresh = false, retired = false;
  };
  /// What is to be ordered anew.
  struct Detached {
    std::vector<std::int32_t> members;  ///< variables of the affected nodes and fresh ones, rising
    std::vector<std::int32_t> orphans;  ///< children of those nodes that stay
  };
  std::int32_t new_node();
  void free_node(std::int32_t n);
  Detached take_down();
  void put_up(const System& system, std::span<const std::int32_t> orphans);
  void lay_out(const System& system, Node& node);
  void connect_children(const System& system, const Node& parent);
  void connect(const System& system, Node& child, const Node& parent);

  const block::Kernels* kernels_;
  std::vector<Node> nodes_;
  std::vector<std::int32_t> free_;
  std::vector<Variable> variables_;
  std::vector<std::int32_t> affected_;  // nodes
  std::vector<std::int32_t> fresh_;     // touched variables in no node
  std::int64_t next_sequence_ = 0;
  int affected_variables_ = 0;
  std::int64_t unsettled_ = 0;
  std::int64_t doubles_ = 0;
  /// So much as factorising everything costs, by the cost model [ns], and so many variables.
  struct Size {
    double cost = 0.0;
    int variables = 0;
  };
  Size now_, when_ordered_;
  Reordering reordering_;
  std::vector<std::int32_t> front_row_;  // by variable, of the node at hand
};

}  // namespace cairn::incremental
