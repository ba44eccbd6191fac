// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "kept_poses.hpp"
#include "ways.hpp"

namespace cairn::compact {

/// The factor that replaces the chains between two kept poses.
struct Bridge {
  FactorId factor = 0;
  Motion motion{};               ///< from the smaller number to the larger
  std::optional<Motion> rest{};  ///< of it, what is in no `Way` any more
};
/// By the numbers of the two poses, the smaller first.
using Bridges = std::map<std::pair<int, int>, Bridge>;

/// Which factors of a compact graph are links, and what the others between kept poses were made of:
/// so that a link can be taken out again.
class LinkRecord {
 public:
  /// A graph without the link of two poses.
  struct Revocation {
    Id a = 0, b = 0;
    GraphUpdate update;  ///< new factors of bridges come first
    std::optional<Ways::Change> ways;
    Bridges bridges;  ///< that change; without a motion: it is none any more
  };

  explicit LinkRecord(CompositionOrder order) : order_(order) {}

  /// Factors that were added: those of two poses are links. `first`: the number of the first.
  void note(std::span<const Factor> links, FactorId first);
  Ways& ways() { return ways_; }
  /// Ends the open way.
  void close_way(Id to, Way::Became became, const KeptPoses& poses);
  /// Null: there is none between these two poses.
  Bridge* bridge(std::pair<int, int> ends);
  void add_bridge(std::pair<int, int> ends, Bridge bridge) { bridges_.emplace(ends, bridge); }

  bool has(Id a, Id b) const;
  /// How the graph is without a link that it has; the estimator must have everything. `type`: of
  /// odometry. Throws `Error` (input) where the link cannot be separated from others any more.
  Revocation without(Id a, Id b, const KeptPoses& poses,
                     const std::shared_ptr<const FactorType>& type) const;
  /// Its update has been carried out, with the first of its factors of this number.
  void revoke(Revocation revocation, FactorId first);

  /// Factors have new numbers.
  void renumber(const std::unordered_map<FactorId, FactorId>& now);
  /// Poses leave by this update, and these factors: what they were is a part of those in their
  /// place, and cannot be taken out any more.
  void merge(const GraphUpdate& leaving, std::span<const Factor> removed);
  /// They have left: pose k has the number `now[k]` now, and the update's factors are those from
  /// `first_factor` on.
  void renumber(const GraphUpdate& leaving, FactorId first_factor, std::span<const int> now,
                const KeptPoses& poses);

 private:
  using Pair = std::pair<Id, Id>;

  std::optional<Ways::Change> ways_without(Id a, Id b, const RigidGroup& group) const;
  void replace_bridges(Revocation& revocation, const KeptPoses& poses,
                       const std::shared_ptr<const FactorType>& type) const;
  void replace_odometry(Revocation& revocation, const KeptPoses& poses,
                        const std::shared_ptr<const FactorType>& type) const;
  FactorId odometry_factor(Id from, Id to, const Estimator& estimator) const;

  CompositionOrder order_;
  /// The factors of links whose two poses are kept, by the smaller id and the larger.
  std::map<Pair, std::vector<FactorId>> links_;
  Bridges bridges_;
  Ways ways_;  ///< with the links of poses that are not kept
};

/// The change that makes a factor measure `motion`, from pose `from` to the other of its two poses.
/// What took the place of poses that have left may go from the later to the earlier, and be of
/// another type than odometry.
ChangedFactor replaced(FactorId factor, Id from, const Motion& motion, const KeptPoses& poses);

}  // namespace cairn::compact
