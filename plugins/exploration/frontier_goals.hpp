// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/exploration/path_planner.hpp"

namespace cairn::exploration {

/// Paths to frontiers, for the explorers that drive there.
///
/// A frontier at which the robot is, at which it looks, and which is there still, is given up until
/// the map around it changes, the second time until clearly more of it is known: it would drive
/// there for ever.
class FrontierGoals {
 public:
  explicit FrontierGoals(std::unique_ptr<PathPlanner> planner) : planner_(std::move(planner)) {}

  void begin();
  /// Looks at the frontiers of a situation, for those that follow. `tight`: through gaps, too, that
  /// may be a cell narrower than the body: on a map, whose cells are occupied as a whole, it may
  /// seem not to fit through a door through which it has come.
  void start(const Situation& situation, bool tight);
  /// Paths to the frontiers of at least this length [m].
  std::vector<Candidate> candidates(double least);
  /// A path to where the robot can stand as at a pose, with its heading at the end; none: there is
  /// no path, or it is there already.
  std::optional<PlannedPath> path_to(const Pose2& pose);

  /// Where none of the frontiers that the last `candidates` has seen has a path: a turn of one
  /// motion, until the robot has turned once around. With noise the newest scan alone may close a
  /// door near the robot, which it does not see with another heading.
  std::optional<PlannedPath> look_around();

  /// Whether there is a frontier yet where the middle of one was.
  static bool is_there(const FloorMap& map, const Eigen::Vector2d& middle);

  /// Of the frontiers that the last `candidates` has seen, those without a path, and their longest.
  std::size_t unreachable() const { return unreachable_; }
  double longest_unreachable() const { return longest_unreachable_; }

 private:
  struct GivenUp {
    Eigen::Vector2d goal;
    std::size_t known;  ///< cells around it
    int times;          ///< that it was reached in vain
  };

  std::optional<PlannedPath> path_to(const Frontier& frontier);
  std::optional<PlannedPath> path_to(const Eigen::Vector2d& goal);
  void give_up(const Eigen::Vector2d& goal);
  bool is_given_up(const Eigen::Vector2d& goal) const;
  std::size_t known_around(const Eigen::Vector2d& point) const;
  /// A path as the robot can drive it; none: it can't.
  std::optional<PlannedPath> driven(PlannedPath path) const;
  bool moves(const PlannedPath& path) const;

  std::unique_ptr<PathPlanner> planner_;
  const Situation* situation_ = nullptr;
  std::vector<GivenUp> given_up_;
  std::size_t unreachable_ = 0;
  double longest_unreachable_ = 0.0;
  double looked_around_ = 0.0;  // since there was a path [rad]
};

}  // namespace cairn::exploration
