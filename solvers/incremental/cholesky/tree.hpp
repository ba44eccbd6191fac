// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "block/kernels.hpp"
#include "block/symbolic.hpp"
#include "cairn/runtime/aligned.hpp"
#include "pace.hpp"
#include "small_graph.hpp"
#include "states.hpp"
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
/// the difference). `factorize` computes it from H and the update matrices of the subtrees below,
/// and `solve` propagates a step down the tree as far as it matters (equations 8 to 10 there).
class Tree {
 public:
  /// `bound[v]`: how many factors of a variable depend on a rigid motion of everything (priors,
  /// factors to constant variables, factors that are not relative).
  Tree(const System& system, States& states, const std::vector<std::int32_t>& bound,
       const block::Kernels& kernels)
      : system_(&system), states_(&states), bound_(&bound), kernels_(&kernels) {}

  /// The same tree, on copies of what it stands on.
  Tree(const Tree& other, const System& system, States& states,
       const std::vector<std::int32_t>& bound);

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

  /// A variable that will probably be touched in one of the next updates.
  struct Expected {
    std::int32_t variable;
    bool soon;  ///< in one of the very next
  };
  /// Reorders the affected variables, those last that were touched last, those near them and those
  /// that are expected soon, and before them what else is expected: `touched_at[v]` says when, and
  /// from `since` on it counts.
  void restructure(std::span<const std::int64_t> touched_at, std::int64_t since,
                   std::span<const Expected> expected = {});
  /// Whether the factor has become more costly, since all of it was last ordered, than the growth
  /// of the graph explains.
  bool worn_out() const;
  /// About how long it would take to order and factorise all of it.
  double seconds_to_order_anew() const;
  /// Computes the affected nodes. Returns -1, or a variable whose pivots are not positive; then the
  /// tree is invalid until everything has been touched and factorised.
  std::int32_t factorize() {
    Pace any;
    begin_factorization(0.0);
    return factorize_more(any);
  }
  /// The same in pieces, a node or a part of a large one (see `Progress`): `factorize_more` returns
  /// `kPaused` where there is no time for the next piece, and goes on there when it is called
  /// again. Until it has ended nothing may be touched, and H must not change. The factor is that of
  /// H with its diagonal times 1 + `damping`, and has the same bits however often it has paused.
  void begin_factorization(double damping);
  std::int32_t factorize_more(Pace& pace);
  static constexpr std::int32_t kPaused = -2;
  /// Solves H δ = g, where g is zero but at `sources` and leaves as zero. `steps`, all zero before,
  /// gets δ of the variables that `changed` then lists. Returns gᵀ H⁻¹ g.
  ///
  /// Steps are propagated down the tree where they matter. The steps of a subtree's separator are
  /// accumulated, squared and weighted with the diagonal of H; they are deferred (`owed`) while
  /// that is less than `tolerance`. A subtree that is `movable` follows a rigid motion of its
  /// separator by moving as a whole, which is exact and is only recorded (`lead`); the rest is
  /// deferred.
  double solve(std::span<const std::int32_t> sources, double tolerance, std::vector<double>& g,
               std::vector<double>& steps, std::vector<std::int32_t>& changed);
  /// The same in pieces, false where there is no time for the next node: `begin_climb`, `climb`
  /// until it has ended, then gᵀ H⁻¹ g is `climbed`; then either `end_decrement`, or
  /// `begin_descent`, and `descend` until it has ended. Nothing else may be called in between but
  /// what is const.
  void begin_climb(std::span<const std::int32_t> sources);
  bool climb(std::vector<double>& g, Pace& pace);
  double climbed() const { return climbed_; }
  void end_decrement(std::vector<double>& g);
  void begin_descent();
  bool descend(double tolerance, std::vector<double>& g, std::vector<double>& steps,
               std::vector<std::int32_t>& changed, Pace& pace);
  /// gᵀ H⁻¹ g alone, the predicted decrease of chi2. Leaves g as zero.
  double decrement(std::span<const std::int32_t> sources, std::vector<double>& g);
  /// Applies the deferred steps of the nodes on the path from a variable to its root. To be called
  /// before the factors of a variable change.
  void follow(std::int32_t variable, std::vector<double>& steps,
              std::vector<std::int32_t>& changed);

  /// Drops the deferred steps of all nodes. To be called where the last steps are undone, before
  /// everything is linearised anew: what is deferred contains a part of them.
  void drop_deferred();

  /// Applies what the nodes above a variable are to be moved by to their states: x_v is then right.
  void settle(std::int32_t variable);
  void settle_all();
  /// Whether anything of that is to be applied to x_v, and if so x_v as it would be, in `x`.
  /// Changes nothing.
  bool read(std::int32_t variable, double* x) const;
  /// All states, as `settle_all` would leave them.
  Estimate settled() const { return settled(states_->estimate(), {}); }
  /// The same for these states, and with these leads of some nodes instead of theirs.
  using Leads = std::unordered_map<std::int32_t, std::vector<double>>;
  Estimate settled(Estimate estimate, const Leads& leads) const;
  /// Undoes what was noted for a node (see `States::undo`).
  void undo_lead(std::int32_t node, std::span<const double> lead) {
    nodes_[node].lead.assign(lead.begin(), lead.end());
    ++leads_;
  }
  /// A variable of a separator has a further step as seen from a subtree that has moved as a whole:
  /// what is deferred there is counted from where the motion has brought it.
  struct Turn {
    std::int32_t node, variable;
    std::size_t step;  ///< where in `turned_steps`
  };
  /// Those of the last `solve`.
  std::span<const Turn> turns() const { return turns_; }
  std::span<const double> turned_steps() const { return turned_steps_; }
  /// Whether a variable is in the subtree of a node.
  bool below(std::int32_t variable, std::int32_t node) const;

  /// X = H⁻¹ B for eight right-hand sides side by side, rows as in δ. `sources`: variables at which
  /// B is not zero. X: room for 8 × scalars() doubles, zero but for B.
  void solve_many(std::span<const std::int32_t> sources, AlignedVector& X);
  /// The same, but only for the rows of variables on the paths from `sources` to the roots.
  void solve_many_above(std::span<const std::int32_t> sources, AlignedVector& X);
  /// Its first half, X = L⁻¹ B: zero but for the own variables of the nodes in `path`.
  void forward_many(std::span<const std::int32_t> sources, AlignedVector& X);
  /// The nodes on the paths from the last `sources` to the roots, children first.
  std::span<const std::int32_t> path() const { return path_; }
  /// The second half, X = L⁻ᵀ X from the roots down, as far as `enter(node)` says for nodes that
  /// are not in `path`: their rows then stay zero, and those of all below. `visit(node)` is called
  /// when the rows of its own variables are done.
  template <class Enter, class Visit>
  void backward_many(AlignedVector& X, const Enter& enter, const Visit& visit) {
    for (const std::int32_t n : path_) on_path_[n] = 1;
    stack_.clear();
    for (const std::int32_t n : path_) {
      if (nodes_[n].parent < 0) stack_.push_back(n);
    }
    while (!stack_.empty()) {
      const std::int32_t n = stack_.back();
      stack_.pop_back();
      const Node& node = nodes_[n];
      if (!std::exchange(on_path_[n], 0) && !enter(node)) continue;
      backward_many(node, X);
      visit(node);
      stack_.insert(stack_.end(), node.children.begin(), node.children.end());
    }
  }

  /// Node of a variable, -1 for none.
  std::int32_t node_of(std::int32_t variable) const {
    return variable < static_cast<std::int32_t>(node_of_.size()) ? node_of_[variable] : -1;
  }
  const std::vector<Node>& nodes() const { return nodes_; }
  const block::Kernels& kernels() const { return *kernels_; }
  std::span<const std::int32_t> affected() const { return affected_; }
  int affected_variables() const { return affected_variables_; }
  /// So many nodes were detached with steps or motions still deferred, which are lost: none if
  /// their variables were followed (`follow`) before they were touched.
  std::int64_t unsettled() const { return unsettled_; }
  std::int64_t doubles() const { return doubles_; }
  double log_determinant() const;
  /// Nodes with parents before their children.
  void top_down(std::vector<std::int32_t>& nodes) const;
  /// Where the scalars of a variable start among the rows of a node's front.
  std::int32_t front_row(const Node& node, std::int32_t variable) const;

 private:
  class FrontPieces;
  /// How far the factorisation of a node has come.
  struct Progress {
    enum class Part : std::uint8_t {
      zero,                ///< the panel: doubles
      assemble_H,          ///< the entries of H, at once
      add_to_panel,        ///< children: the next one's columns up to `end`
      zero_update,         ///< the update matrix, if there are …
      add_scattered_ones,  ///< … children whose separator has another order than the front
      columns,             ///< of the panel: a strip, and its rows up to `end`
      update,              ///< the update matrix: rows of the front
      add_scattered_part,  ///< `children_part`: doubles
      add_to_update        ///< children, as to the panel
    };
    Part part = Part::zero;
    std::int64_t next = 0, end = 0;     ///< the part goes on there; where its last piece ended
    bool scattered = false;             ///< there are such children, …
    UninitializedVector children_part;  ///< … and this is what they add to the update matrix
    int failed = -1;                    ///< the first column whose pivot is not positive

    void go_to(Part other) {
      part = other;
      next = end = 0;
    }
  };
  void make_room_for_variables();
  std::int32_t new_node();
  void free_node(std::int32_t n);
  void take_down(std::vector<std::int32_t>& members, std::vector<std::int32_t>& orphans);
  void group(std::span<const std::int64_t> touched_at, std::int64_t since,
             std::span<const Expected> expected);
  void add_near();
  void order_small();
  void order_large();
  void eliminate();
  void merge();
  void put_up(std::span<const std::int32_t> orphans);
  void lay_out(Node& node);
  void connect_children(const Node& parent);
  void connect(Node& child, const Node& parent);
  void assemble(Node& node);
  bool fill_with_zeros(std::span<double> array, const FrontPieces& front);
  bool add_child(const Node& child, std::int32_t first, std::int32_t last, double* parent,
                 std::int64_t parent_stride, const FrontPieces& front);
  bool add_scattered(const Node& child, Node& parent, const FrontPieces& front);
  bool factorize_node(Node& node, Pace& pace);
  bool factorize_columns(Node& node, const FrontPieces& front);
  bool add_children_part(Node& node, const FrontPieces& front);
  void solve_node(Node& node, const double* y, std::vector<double>& steps,
                  std::vector<std::int32_t>& changed);
  double owed_square(const Node& node) const;
  bool move_as_a_whole(Node& node, double tolerance);
  void add_lead(Node& node, const std::vector<double>& lead);
  void hand_down(Node& node);
  void collect_paths(std::span<const std::int32_t> sources);
  void backward_many(const Node& node, AlignedVector& X);

  const System* system_;
  States* states_;
  const std::vector<std::int32_t>* bound_;
  const block::Kernels* kernels_;
  std::vector<Node> nodes_;
  std::vector<std::int32_t> free_;
  std::vector<std::int32_t> node_of_;   // by variable
  std::vector<std::int32_t> affected_;  // nodes
  std::vector<std::int32_t> fresh_;     // touched variables in no node
  std::vector<std::uint8_t> is_fresh_;  // by variable
  std::vector<std::uint8_t> retired_;   // by variable
  std::size_t factorized_ = 0;          // of them
  Progress progress_;                   // of the one at hand
  double damping_ = 0.0;
  std::int64_t next_sequence_ = 0;
  int affected_variables_ = 0;
  std::int64_t unsettled_ = 0;
  std::int64_t doubles_ = 0;
  double cost_ = 0.0;  // of factorising everything, by the cost model [ns]
  int variables_ = 0;  // in the tree
  double cost_when_ordered_ = 0.0;
  int variables_when_ordered_ = 0;

  // Room for restructuring: columns by place in the order, see eliminate().
  SmallGraph graph_;
  std::vector<std::int32_t> members_, orphans_, order_, local_;  // local_: by variable
  std::vector<std::uint8_t> groups_;  // by member: those of a higher one are ordered later
  std::vector<std::int64_t> column_begin_;
  std::vector<std::int32_t> column_rows_, column_parent_, mark_, first_child_, sibling_,
      orphan_first_, orphan_next_;
  std::vector<std::int32_t> merged_into_, top_of_;
  std::vector<double> scalars_below_, scalars_own_;
  std::vector<std::int32_t> front_row_;  // by variable, of the node at hand
  AlignedVector front_;
  std::vector<Turn> turns_;
  std::vector<double> turned_steps_;
  std::vector<double> rigid_, matrix_, lead_;
  std::int64_t leads_ = 0;  // so many motions have been noted
  std::vector<std::int32_t> stack_, path_, settle_path_;
  std::size_t next_on_path_ = 0;
  double climbed_ = 0.0;
  std::vector<std::uint8_t> on_path_;  // by node
};

}  // namespace cairn::incremental
