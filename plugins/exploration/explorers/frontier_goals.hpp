// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/exploration/known_surroundings.hpp"
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
  /// Looks at the frontiers of a situation, for those that follow.
  void start(const Situation& situation);
  /// From here on paths lead through gaps, too, that are a cell narrower on each side than the
  /// body (`narrow_radius`). False: several of those paths have led nowhere in a row, and there is
  /// another way to the first pose, so that the robot is not shut in.
  bool start_through_gaps();
  /// Paths to the frontiers of at least this length [m].
  std::vector<Candidate> candidates(double least);
  /// A path to where the robot can stand as at a pose, with its heading at the end; none: there is
  /// no path, or it is there already.
  std::optional<PlannedPath> path_to(const Pose2& pose);

  /// The robot drives along one of the `candidates`. A frontier to which it drives again and again
  /// without coming nearer, since it is stopped on the way, is given up as well: one behind a
  /// narrow gap at once, if the robot has set out.
  void chosen(const PlannedPath& path);

  /// Where none of the frontiers that the last `candidates` has seen has a path: a turn of one
  /// motion, until the robot has turned once around; one that can't turn in place backs, some times
  /// in a row. With noise the newest scan alone may close a
  /// door near the robot, which it does not see with another heading.
  std::optional<PlannedPath> look_around();

  /// Whether there is a frontier yet where the middle of one was.
  static bool is_there(const FloorMap& map, const Eigen::Vector2d& middle);

  /// Of the frontiers that the last `candidates` has seen, those without a path, and their longest.
  std::size_t unreachable() const { return unreachable_; }
  double longest_unreachable() const { return longest_unreachable_; }

 private:
  struct GivenUp {
    KnownSurroundings goal;
    int times;  ///< that it was reached in vain
  };
  /// A goal to which the robot has driven, and how often without coming nearer.
  struct Attempted {
    KnownSurroundings goal;
    double length;  ///< of the shortest path to it so far [m]
    /// Weights of the attempts, along ordinary paths and through gaps (`settle_attempt`).
    int wide = 0, narrow = 0;
  };
  /// What was chosen last.
  struct Attempt {
    KnownSurroundings goal;
    double length;  ///< of the path [m]
    Pose2 from;
    bool narrow;
  };

  void settle_attempt();
  std::optional<PlannedPath> path_to(const Frontier& frontier);
  std::optional<PlannedPath> path_to(const Eigen::Vector2d& goal);
  void give_up(const Eigen::Vector2d& goal);
  bool is_given_up(const Eigen::Vector2d& goal) const;
  bool comes_no_nearer(const Eigen::Vector2d& goal, double length) const;
  bool moves(const PlannedPath& path) const;

  std::unique_ptr<PathPlanner> planner_;
  const Situation* situation_ = nullptr;
  std::vector<GivenUp> given_up_;
  std::vector<Attempted> attempted_;
  std::optional<Attempt> attempt_;
  int narrow_failures_ = 0;  // in a row
  std::size_t unreachable_ = 0;
  double longest_unreachable_ = 0.0;
  double looked_around_ = 0.0;                // at one place [rad]
  std::optional<Eigen::Vector2d> looked_at_;  // that place [m]
  int backed_ = 0;                            // times in a row
  double narrow_radius_ = 0.0;                // of the body that paths are for [m]; 0: the robot's
};

}  // namespace cairn::exploration
