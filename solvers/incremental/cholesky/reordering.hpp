// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "small_graph.hpp"
#include "system.hpp"

namespace cairn::incremental {

/// A variable that will probably be touched in one of the next updates.
struct Expected {
  std::int32_t variable;
  bool soon;  ///< in one of the very next
};

/// What a part of the elimination tree is ordered by.
struct Recency {
  std::span<const std::int64_t> touched_at;  ///< by variable
  std::int64_t since = 0;                    ///< touched from then on is recent
  std::span<const Expected> expected;
};

/// A new order of some variables, and the supernodes that their columns of L make up. Keeps its
/// memory from one use to the next.
///
/// Columns are counted by their places in the order. Those of a supernode are merged to the last of
/// them, its top, as long as one larger front is cheaper than two.
class Reordering {
 public:
  /// Orders `members` (rising), which H joins, and each of the cliques, the separators of the
  /// subtrees that stay below: those last that are recent, those near them and those expected soon,
  /// and before them what else is expected.
  void compute(const System& system, std::span<const std::int32_t> members,
               std::span<const std::span<const std::int32_t>> cliques, const Recency& recency);

  /// Variables by place.
  std::span<const std::int32_t> order() const { return order_; }
  /// The last column of the supernode that column k is a part of.
  std::int32_t top_of(std::int32_t k) const { return top_of_[k]; }
  /// The column of the first row of column k below the diagonal, or -1.
  std::int32_t parent(std::int32_t k) const { return column_parent_[k]; }
  /// The rows of a top below the diagonal, rising.
  std::span<const std::int32_t> rows(std::int32_t top) const {
    return std::span(column_rows_)
        .subspan(static_cast<std::size_t>(column_begin_[top]),
                 static_cast<std::size_t>(column_begin_[top + 1] - column_begin_[top]));
  }
  /// visit(clique) for those whose first variable is that of column k.
  template <class Visit>
  void for_each_clique(std::int32_t k, const Visit& visit) const {
    for (std::int32_t c = clique_first_[k]; c >= 0; c = clique_next_[c]) visit(c);
  }

 private:
  using Cliques = std::span<const std::span<const std::int32_t>>;
  void group(const System& system, std::span<const std::int32_t> members, const Recency& recency);
  void add_near(const System& system, std::span<const std::int32_t> members);
  void order_small(const System& system, std::span<const std::int32_t> members, Cliques cliques);
  void order_large(const System& system, std::span<const std::int32_t> members, Cliques cliques);
  void eliminate(const System& system, Cliques cliques);
  void merge(const System& system);

  SmallGraph graph_;
  std::vector<std::int32_t> order_;
  std::vector<std::int32_t> place_;   // by variable; -1 between calls
  std::vector<std::uint8_t> groups_;  // by member: those of a higher one are ordered later
  std::vector<std::int32_t> stack_;
  // By column:
  std::vector<std::int64_t> column_begin_;  // in column_rows_
  std::vector<std::int32_t> column_rows_, column_parent_, mark_, first_child_, sibling_;
  std::vector<std::int32_t> clique_first_, clique_next_;  // the latter by clique
  std::vector<std::int32_t> merged_into_, top_of_;
  std::vector<double> scalars_below_, scalars_own_;
};

}  // namespace cairn::incremental
