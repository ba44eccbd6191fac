// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "block/symbolic.hpp"

namespace cairn::block {

/// Who works off which supernode, and where its update matrix is kept meanwhile.
///
/// The elimination tree is cut into *tasks* (one or several neighbouring subtrees) of about equal
/// work and the *levels* above them: the supernodes of one level have nothing to do with each
/// other. The cut depends on the structure alone, never on the number of threads. The room for
/// update matrices does: one lane works off everything in postorder, like a stack; several lanes
/// each take tasks in a stretch of their own.
struct Schedule {
  struct Task {
    std::int32_t begin, end;  ///< supernodes
    double work;              ///< in about flops
  };
  std::vector<Task> tasks;  ///< falling work
  std::vector<std::vector<std::int32_t>> levels;
  std::vector<std::int32_t> task_of;  ///< by supernode: its task, -1 above them

  int lanes = 1;
  std::vector<std::int64_t> place;  ///< by supernode: where its update matrix starts
  std::vector<bool> in_lane;        ///< whether `place` counts from the lane's stretch
  std::int64_t lane_size = 0;  ///< doubles of a lane's stretch; lane k's starts at k times that
  std::int64_t size = 0;       ///< doubles in all

  Schedule() = default;
  Schedule(const Symbolic& symbolic, int threads);

 private:
  void cut(const Symbolic& symbolic);
  void place_as_stack(const Symbolic& symbolic);
  void place_in_lanes(const Symbolic& symbolic);
};

}  // namespace cairn::block
