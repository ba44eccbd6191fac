// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "block/kernels.hpp"
#include "cairn/linear/block_matrix.hpp"
#include "cairn/runtime/aligned.hpp"

namespace cairn::block {

/// A list of so many elements that the first touch of its memory counts.
template <class T>
using LongList = std::vector<T, AlignedAllocator<T>>;

/// One supernode: consecutive columns of L that share their rows below.
struct Supernode {
  std::int32_t block_begin, block_end;  ///< its blocks, in elimination order
  std::int64_t rows_begin, rows_end;    ///< its block rows below the diagonal, in `Symbolic::rows`
  std::int32_t parent;                  ///< supernode of the first row below, -1 for a root
  std::int32_t columns;                 ///< scalar columns
  std::int32_t m;                       ///< scalar rows of the front: columns and rows below
  std::int32_t stride;                  ///< m rounded up to 8
  std::int64_t panel;                   ///< where its panel starts in the factor's values
  std::int64_t spreads_begin,
      spreads_end;  ///< how its update matrix maps onto the parent's front, in `Symbolic::spreads`
  std::int32_t panel_rows;  ///< the first so many of its rows below are columns of the parent

  /// Doubles of the update matrix.
  std::int64_t update_size() const { return std::int64_t(m - columns) * update_stride(); }
  std::int32_t update_stride() const { return stride - columns / 8 * 8; }
};

/// How the merging of supernodes weighs work: rough times in nanoseconds on one core. They decide
/// how much explicit zero is worth one supernode less, and nothing else.
struct CostModel {
  double supernode = 120.0;
  double panel_entry = 0.25;
  double panel_flop = 0.05;
  double update_flop = 0.025;
  double extend_entry = 0.8;

  /// Modelled time of one supernode of so many scalar columns and scalar rows below them.
  double time(double columns, double below) const;
};

/// Everything about the factorisation P H Pᵀ = L Lᵀ that depends on the structure alone:
/// elimination order (the given ordering, postordered), supernodes after relaxed amalgamation,
/// their rows, and the index lists by which numbers move.
class Symbolic {
 public:
  Symbolic() = default;
  Symbolic(const BlockStructure& structure, std::span<const std::int32_t> ordering,
           const CostModel& cost = {})
      : Symbolic(outline(structure, ordering)) {
    complete(structure, cost);
  }

  /// A third of the work: order, elimination tree, `factor_nonzeros` and `factor_flops`, enough to
  /// compare orderings. `complete` does the rest.
  static Symbolic outline(const BlockStructure& structure, std::span<const std::int32_t> ordering);
  /// Of an outline of the same structure.
  void complete(const BlockStructure& structure, const CostModel& cost = {});

  std::span<const std::int32_t> order() const { return order_; }        ///< position → block
  std::span<const std::int32_t> position() const { return position_; }  ///< block → position
  std::span<const std::int64_t> offsets() const {
    return offsets_;
  }  ///< position → first scalar row; n+1 entries

  std::span<const Supernode> supernodes() const {
    return supernodes_;
  }  ///< in elimination order (a postorder)
  std::span<const std::int32_t> rows() const { return rows_; }  ///< block positions
  std::span<const Spread> spreads() const { return spreads_; }
  /// Entries of H by the supernode that they go to.
  std::span<const Assembly> assembly(int supernode) const {
    return std::span(assembly_).subspan(
        assembly_begin_[supernode], assembly_begin_[supernode + 1] - assembly_begin_[supernode]);
  }
  std::span<const std::int32_t> children(int supernode) const {
    return std::span(children_).subspan(
        children_begin_[supernode], children_begin_[supernode + 1] - children_begin_[supernode]);
  }
  std::int64_t panel_values() const {
    return panel_values_;
  }  ///< doubles in all panels, padding included

  std::int64_t factor_nonzeros = 0;  ///< scalars in L without amalgamation or padding
  double factor_flops = 0.0;         ///< Σ (column count)², without amalgamation

 private:
  void find_order(const BlockStructure& structure, std::span<const std::int32_t> ordering);
  void count_rows(const BlockStructure& structure);
  void find_supernodes(const BlockStructure& structure, const CostModel& cost);
  void find_rows(const BlockStructure& structure);
  void lay_out();
  void map_children();
  void assign_entries(const BlockStructure& structure);
  std::int64_t scalars(std::int32_t first, std::int32_t last) const {
    return offsets_[last] - offsets_[first];
  }

  std::vector<std::int32_t> order_, position_;
  std::vector<std::int32_t> parent_;  // elimination tree, by position
  std::vector<std::int32_t>
      counts_;  // block rows in each column of L, diagonal included, by position
  std::vector<std::int64_t> scalar_counts_;  // scalar rows, of an outline
  std::vector<std::int64_t> offsets_;
  std::vector<Supernode> supernodes_;
  std::vector<std::int32_t> supernode_of_;  // by position
  std::vector<std::int32_t> rows_;
  std::vector<Spread> spreads_;
  LongList<Assembly> assembly_;
  std::vector<std::int64_t> assembly_begin_;
  std::vector<std::int32_t> children_;
  std::vector<std::int64_t> children_begin_;
  std::int64_t panel_values_ = 0;
};

}  // namespace cairn::block
