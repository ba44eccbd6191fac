// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "block/front.hpp"
#include "block/symbolic.hpp"

namespace cairn::block {

/// One tile of what a child adds to a large front has so many columns, one tile of setting a panel
/// to zero so many doubles.
inline constexpr int kTileAdded = 24;
inline constexpr std::int64_t kTileZeroed = 1 << 15;

/// A piece of the factorisation that one thread does, with what must be done before.
struct Step {
  enum class Kind : std::uint8_t {
    task,          ///< the supernodes of a task
    front,         ///< a whole supernode above the tasks
    zero,          ///< doubles [begin, end) of a large front's panel
    assemble,      ///< the entries of H
    add_to_panel,  ///< children [child, child_end), or columns [begin, end) of a large child
    pivots,        ///< the diagonal block of columns [first, last)
    rows,          ///< rows [begin, end) below it; then the next strip's pivots, if `pivots_follow`
    subtract,      ///< rows [begin, end) of columns [first, last); then their pivots, likewise
    update,        ///< rows [begin, end) of the update matrix
    add_to_update,  ///< as add_to_panel
    finish          ///< nothing: the supernode is done
  };
  struct Wait {
    std::int32_t gate = -1, count = 0;
  };
  Kind kind = Kind::finish;
  bool pivots_follow = false;
  std::int32_t which = 0;  ///< task or supernode
  std::int32_t child = 0, child_end = 0;
  std::int32_t first = 0, last = 0;
  std::int64_t begin = 0, end = 0;
  Wait waits[2];                                ///< until the gate has been signalled so often
  std::int32_t signals[2] = {-1, -1};           ///< gates, when done
  std::int32_t freed_begin = 0, freed_end = 0;  ///< in `freed`: waits for these gates, too
};

/// Where update matrices are.
struct Placement {
  std::vector<std::int64_t> place;  ///< by supernode: where its update matrix starts
  std::vector<bool> in_lane;        ///< whether `place` counts from the lane's stretch
  std::int64_t lane_size = 0;  ///< doubles of a lane's stretch; lane k's starts at k times that
  std::int64_t size = 0;       ///< doubles in all

  std::int64_t of(std::int32_t s, std::int64_t lane) const {
    return (in_lane[s] ? lane * lane_size : 0) + place[s];
  }
};

/// Which thread processes each supernode, and where its update matrix is kept meanwhile.
///
/// The elimination tree is cut into *tasks* (one or several neighbouring subtrees) of about equal
/// work and the *levels* above them: the supernodes of one level have nothing to do with each
/// other. The cut depends on the structure alone, never on the number of threads. The room for
/// update matrices does: one lane works off everything in postorder, like a stack; several lanes
/// keep what stays within a task in a stretch of their own.
///
/// For several lanes all work is cut into *steps*, in an order in which each comes after all that
/// it waits for. Whichever lanes there are take the next step in turn and wait, if need be, for
/// steps that others have taken before; so there is no deadlock, however many run at once. The
/// order is that in which so many lanes would take the steps if each took as long as its arithmetic
/// says, always the one that is ready and earliest in postorder: update matrices are then used up
/// soon, and as few of them are there at once as one lane has, but for what the others are at.
struct Schedule {
  struct Task {
    std::int32_t begin, end;  ///< supernodes
    double work;              ///< in about flops
  };
  std::vector<Task> tasks;  ///< falling work
  std::vector<std::vector<std::int32_t>> levels;
  std::vector<std::int32_t> task_of;  ///< by supernode: its task, -1 above them

  int lanes = 1;
  Placement placement;

  std::vector<Step> steps;          ///< none for one lane
  std::vector<std::int32_t> freed;  ///< gates of supernodes whose children's room is used again
  std::vector<std::int32_t> ready;  ///< by supernode: gate that its children outside tasks signal
  std::int32_t gates = 0;

  Schedule() = default;
  Schedule(const Symbolic& symbolic, int threads);

  /// Room for all that leaves a task at once, for an order of one level after the other. With one
  /// lane it is `placement`.
  Placement by_levels(const Symbolic& symbolic) const;

 private:
  void cut(const Symbolic& symbolic);
  void place_as_stack(const Symbolic& symbolic);
  void place_in_lanes(const Symbolic& symbolic);
  void list_steps(const Symbolic& symbolic);
};

}  // namespace cairn::block
