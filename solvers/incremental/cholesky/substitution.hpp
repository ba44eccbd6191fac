// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "cairn/runtime/aligned.hpp"
#include "motions.hpp"
#include "pace.hpp"
#include "states.hpp"
#include "system.hpp"
#include "tree.hpp"

namespace cairn::incremental {

/// Steps δ of some variables.
struct Steps {
  std::vector<double> values;         ///< by scalars, zero but for …
  std::vector<std::int32_t> changed;  ///< … these variables

  void clear(const System& system);
};

/// Solves with the Cholesky factor: up the tree from the variables at which the right-hand side is
/// not zero, and down again as far as it matters (IJRR 2017, equations 8 to 10).
///
/// On the way down the steps of a subtree's separator are accumulated, squared and weighted with
/// the diagonal of H; they are deferred (`Node::owed`) while that is less than a tolerance. A
/// subtree that is `movable` follows a rigid motion of its separator by moving as a whole, which is
/// exact and only recorded (`Motions`); the rest is deferred.
class Substitution {
 public:
  /// Solves H δ = g, g being that of the system, zero but at `sources`, and zero again after.
  /// Returns gᵀ H⁻¹ g.
  double solve(System& system, Tree& tree, States& states, Motions& motions,
               std::span<const std::int32_t> sources, double tolerance, Steps& steps);
  /// The same in pieces, false where there is no time for the next node: `begin_climb`, `climb`
  /// until it has ended, then gᵀ H⁻¹ g is `climbed`; then either `end_decrement`, or
  /// `begin_descent`, and `descend` until it has ended. Nothing else may be called in between but
  /// what is const.
  void begin_climb(const Tree& tree, std::span<const std::int32_t> sources);
  bool climb(System& system, const Tree& tree, Pace& pace);
  double climbed() const { return climbed_; }
  void end_decrement(System& system, const Tree& tree) const;
  void begin_descent(const Tree& tree, Motions& motions);
  bool descend(System& system, Tree& tree, States& states, Motions& motions, double tolerance,
               Steps& steps, Pace& pace);
  /// gᵀ H⁻¹ g alone, the predicted decrease of chi2. Leaves g as zero.
  double decrement(System& system, const Tree& tree, std::span<const std::int32_t> sources);

  /// Applies the deferred steps of the nodes on the path from a variable to its root. To be called
  /// before the factors of a variable change.
  void follow(const System& system, Tree& tree, States& states, Motions& motions,
              std::int32_t variable, Steps& steps);
  /// Drops the deferred steps of all nodes. To be called where the last steps are undone, before
  /// everything is linearised anew: what is deferred contains a part of them.
  void drop_deferred(Tree& tree);

  /// X = H⁻¹ B for eight right-hand sides side by side, rows as in δ. `sources`: variables at which
  /// B is not zero. X: room for 8 × scalars() doubles, zero but for B.
  void solve_many(const System& system, const Tree& tree, std::span<const std::int32_t> sources,
                  AlignedVector& X);
  /// The same, but only for the rows of variables on the paths from `sources` to the roots.
  void solve_many_above(const System& system, const Tree& tree,
                        std::span<const std::int32_t> sources, AlignedVector& X);
  /// Its first half, X = L⁻¹ B: zero but for the own variables of the nodes in `path`.
  void forward_many(const System& system, const Tree& tree, std::span<const std::int32_t> sources,
                    AlignedVector& X);
  /// The nodes on the paths from the last `sources` to the roots, children first.
  std::span<const std::int32_t> path() const { return path_; }
  /// The second half, X = L⁻ᵀ X from the roots down, as far as `enter(node)` says for nodes that
  /// are not in `path`: their rows then stay zero, and those of all below. `visit(node)` is called
  /// when the rows of its own variables are done.
  template <class Enter, class Visit>
  void backward_many(const System& system, const Tree& tree, AlignedVector& X, const Enter& enter,
                     const Visit& visit) {
    begin_at_roots(tree);
    while (!stack_.empty()) {
      const std::int32_t n = stack_.back();
      stack_.pop_back();
      const Node& node = tree.nodes()[n];
      if (!std::exchange(on_path_[n], 0) && !enter(node)) continue;
      backward_many(system, tree, node, X);
      visit(node);
      stack_.insert(stack_.end(), node.children.begin(), node.children.end());
    }
  }

 private:
  void collect_paths(const Tree& tree, std::span<const std::int32_t> sources);
  void begin_at_roots(const Tree& tree);
  void make_room(std::int64_t doubles) {
    if (std::ssize(front_) < doubles) front_.resize(static_cast<std::size_t>(doubles));
  }
  void solve_node(const System& system, Tree& tree, Node& node, const double* y, Steps& steps);
  void backward_many(const System& system, const Tree& tree, const Node& node, AlignedVector& X);

  AlignedVector front_;  // of the node at hand
  std::vector<std::int32_t> path_, stack_;
  std::vector<std::uint8_t> on_path_;  // by node; what is left to do between calls
  std::size_t next_on_path_ = 0;
  double climbed_ = 0.0;
};

}  // namespace cairn::incremental
