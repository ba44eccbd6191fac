// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "information_loss.hpp"
#include "kept_poses.hpp"

namespace cairn::compact {

/// Poses that landmarks locate, in places where others stay: they are in the graph until what they
/// measured adds little to it.
class TemporaryPoses {
 public:
  /// What must hold for one to leave.
  struct Conditions {
    InformationLoss most;  ///< that may be lost
    /// A pose that stays, at the place of a kept one; nothing: there is none.
    std::function<std::optional<Id>(int)> cover;
    /// Whether something else waits for it.
    std::function<bool(Id)> needed;
    /// Whether the trajectory continues from there.
    std::function<bool(Id)> followed;
  };
  /// One that leaves.
  struct Leaving {
    Id pose = 0, cover = 0;
    bool joined = false;                  ///< its odometry becomes a part of that to the next pose
    std::vector<LinearFactor> factors{};  ///< all on any of these poses
  };

  bool contains(Id pose) const;
  /// `poses`: of which the newest is one now.
  void add_newest(const KeptPoses& poses);
  void remove(Id pose);
  /// Factors were added, those from this number on.
  void note_factors(FactorId first);
  /// Factors have new numbers.
  void forget_factors();

  /// One to be removed, if a pose that stays is at its place and no more than this is lost about
  /// the map: the oldest with all that it measured, or if too much is lost by that, with what it
  /// measured of landmarks alone, while its odometry becomes a part of that to the next pose. Where
  /// no pose covers it, or more is lost, it is permanent from now on. It waits while it is the
  /// newest pose that would lose too much, or while something else waits for it; if too many wait,
  /// the first whose odometry can be joined is judged all the same. The estimator must have
  /// everything.
  std::optional<Leaving> judge(const Conditions& conditions, const KeptPoses& poses);

 private:
  struct Temporary {
    Id id = 0;
    FactorId since = 0;  ///< no older factor is on it
  };
  /// The estimator does not have the pose yet.
  static constexpr FactorId kComing = std::numeric_limits<FactorId>::max();

  std::vector<LinearFactor> factors(Estimator& estimator) const;

  std::vector<Temporary> poses_;  ///< in the order of arrival
  FactorId latest_factors_ = 0;   ///< the first of those that came last
};

}  // namespace cairn::compact
