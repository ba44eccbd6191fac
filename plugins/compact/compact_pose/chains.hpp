// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <unordered_set>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/geometry/pose_chain.hpp"
#include "rigid_group.hpp"
#include "ways.hpp"

namespace cairn::compact {

/// The odometry chains of a trajectory, from each kept pose to the next one, from which the poses
/// that were left out are recovered.
class Chains {
 public:
  /// With false nothing is remembered.
  void keep(bool keep) { keeps_ = keep; }
  /// In order, without that to the newest pose while it is not kept.
  const std::vector<OdometryChain>& all() const { return all_; }

  /// The trajectory goes on to a pose; `matched` as `ChainStep` has it.
  void step(Id pose, const Motion& motion, bool matched = false);
  /// The steps since the last chain lead to a pose that is kept.
  void end(Id from, Id to);
  /// Some ways become others: the poses of their chains stay, and are divided as the ways are.
  /// `first`: the first of the old ones; null: the open way alone changes.
  void divide(const Ways::Change& change, const Way* first, const MotionGroup& motions);
  /// Whether one ends at this pose.
  bool end_at(Id pose) const;
  /// The last chain to a pose that leaves ends at its cover now, as one that ends with a match, and
  /// the next begins there. `there`: the displacement from the cover to the pose.
  void recast(Id leaving, Id cover, const Displacement& there, const RigidGroup& group);
  /// The way from one kept pose to the next leads past those that have left.
  void join(const std::unordered_set<Id>& gone);

 private:
  std::size_t find(const Way& way) const;

  bool keeps_ = true;
  std::vector<OdometryChain> all_;
  std::vector<ChainStep> open_;  ///< to the newest pose
};

}  // namespace cairn::compact
