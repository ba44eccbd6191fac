// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "segmented_array.hpp"

namespace cairn::incremental {

/// The normal equations H δ = g of a graph that grows and changes: H by blocks, each with a place
/// of its own, found from the variables that it joins. Blocks are added to and taken away from;
/// nothing is ever assembled anew.
class System {
 public:
  /// One neighbour of a variable, and the block that joins them.
  struct Link {
    std::int32_t other;
    std::int32_t entry;
  };

  /// A variable with `size` tangent coordinates; returns its number, the next one.
  std::int32_t add_variable(std::int32_t size);
  int variables() const { return static_cast<int>(sizes_.size()); }
  std::int32_t size(std::int32_t v) const { return sizes_[v]; }
  /// First scalar of a variable in vectors such as g and δ.
  std::int64_t offset(std::int32_t v) const { return offsets_[v]; }
  std::int64_t scalars() const { return scalars_; }
  std::span<const Link> links(std::int32_t v) const { return links_[v]; }

  /// The block of two different variables, which is made if it is not there, and counted: one for
  /// each factor on both. Returns its entry.
  std::int32_t connect(std::int32_t a, std::int32_t b);
  /// Undoes one `connect`; with the last the block is gone.
  void disconnect(std::int32_t a, std::int32_t b);
  /// The entry of a pair that has been connected.
  std::int32_t find(std::int32_t a, std::int32_t b) const;

  /// H_vv, column-major.
  double* diagonal(std::int32_t v) { return values_.at(diagonals_[v]); }
  const double* diagonal(std::int32_t v) const { return values_.at(diagonals_[v]); }
  /// H_ab with a < b: size_a × size_b, column-major.
  double* block(std::int32_t entry) { return values_.at(entries_[entry].value); }
  const double* block(std::int32_t entry) const { return values_.at(entries_[entry].value); }
  /// The right-hand side, zero but while it is being solved for (see `Models::right_hand_side`).
  std::vector<double>& g() { return g_; }
  double* g(std::int32_t v) { return g_.data() + offsets_[v]; }
  const double* g(std::int32_t v) const { return g_.data() + offsets_[v]; }

  // The gradient of a variable, −g_v: either all of it, `gradient` and `change`, or what has come
  // since it was last solved for, `pending`.

  /// Σ Jᵀr over a variable's factors, each when it was last evaluated, as seen from the variable.
  double* gradient(std::int32_t v) { return gradient_.data() + offsets_[v]; }
  /// What steps have changed in it since, in the variable's frame.
  double* change(std::int32_t v) { return change_.data() + offsets_[v]; }
  /// Σ Jᵀr of the factors that have come since g_v was last solved for, as seen from the variable.
  double* pending(std::int32_t v) { return pending_.data() + offsets_[v]; }
  bool counts_all(std::int32_t v) const { return counts_all_[v] != 0; }
  /// All of the gradient counts from here on, including what had been deferred.
  void count_all(std::int32_t v);
  /// g_v has been solved for.
  void mark_solved(std::int32_t v);
  /// g_v counts as if it had been solved for, until all of the gradient counts again.
  void set_aside(std::int32_t v);
  bool has_set_aside(std::int32_t v) const;
  /// For a variable that no factor in H is on: its gradient is zero, without what rounding has
  /// left.
  void clear_gradient(std::int32_t v);

  /// H and all vectors become zero; the blocks stay.
  void clear_values();

  std::int64_t doubles() const { return values_.size() + 5 * std::ssize(g_); }

 private:
  struct Entry {
    std::int64_t value;
    std::int32_t doubles;
    std::int32_t factors;
  };
  std::int64_t take(std::int32_t doubles);

  std::vector<std::int32_t> sizes_;
  std::vector<std::int64_t> offsets_;
  std::vector<std::int64_t> diagonals_;
  std::vector<std::vector<Link>> links_;
  std::vector<Entry> entries_;
  std::vector<std::int32_t> free_entries_;
  std::vector<std::vector<std::int64_t>> free_values_;  // by number of doubles
  SegmentedArray values_;
  std::vector<double> g_, pending_, gradient_, change_, aside_;
  std::vector<std::uint8_t> counts_all_;  // by variable
  std::int64_t scalars_ = 0;
};

}  // namespace cairn::incremental
