// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/runtime/aligned.hpp"
#include "pace.hpp"
#include "system.hpp"
#include "tree.hpp"

namespace cairn::incremental {

/// Computes the affected nodes of a tree, in pieces: a node, or a part of a large one.
///
/// The factor is that of H with its diagonal times 1 + `damping`, and has the same bits however
/// often it has paused. From `begin` until it has ended nothing may be touched, and H must not
/// change.
class Factorization {
 public:
  static constexpr std::int32_t kDone = -1, kPaused = -2;

  void begin(Tree& tree, double damping);
  /// Goes on. Returns `kDone`; `kPaused` where there is no time for the next piece, and then goes
  /// on there when it is called again; or a variable whose pivots are not positive: then the tree
  /// is invalid until everything has been touched and factorised.
  std::int32_t more(const System& system, Tree& tree, Pace& pace);
  /// All of it at once, undamped.
  std::int32_t compute(const System& system, Tree& tree) {
    Pace any;
    begin(tree, 0.0);
    return more(system, tree, any);
  }

 private:
  class Front;
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

  static std::int32_t bad_pivot(const Front& front);
  bool factorize(Front& front);
  bool fill_with_zeros(std::span<double> array, const Front& front);
  void assemble(Front& front);
  bool add_child(const Node& child, std::int32_t first, std::int32_t last, double* parent,
                 std::int64_t parent_stride, const Front& front);
  bool add_scattered(const Node& child, Front& front);
  bool factorize_columns(Front& front);
  bool add_children_part(Front& front);

  std::size_t next_ = 0;  // of the affected nodes
  Progress progress_;     // of that one
  double damping_ = 0.0;
  std::vector<std::int32_t> front_row_;  // by variable, of that one
};

}  // namespace cairn::incremental
