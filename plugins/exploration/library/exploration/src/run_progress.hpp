// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "cairn/exploration/discovered_floor.hpp"
#include "mapping_robot.hpp"

namespace cairn {

/// A motion that moves the robot by less is none [m], [rad].
inline constexpr double kNoMotion = 0.005;

/// Whether a run gets on: what went wrong so many times in a row, and how far was driven without
/// finding more floor.
class RunProgress {
 public:
  /// `idle_distance`: `ExplorationLimits::idle_distance`.
  explicit RunProgress(double idle_distance) : most_idle_(idle_distance) {}

  /// The map after so many metres, which must be that of each motion.
  void discover(const FloorMap& map, double driven);
  /// An explorer has decided, after so many metres.
  void decide(double driven);
  /// A path is given up or at its end: whether the robot has moved on it, and whether something was
  /// in its way before a motion.
  void end_path(bool moved, bool refused);
  /// A motion along a path is free to be made.
  void set_out(const Pose2& motion);
  /// `backs_off`: after a collision, or before one.
  void move(const MadeMotion& motion, bool backs_off, double radius);

  /// A sentence; none: it gets on, after so many metres.
  std::optional<std::string> why_stuck(double driven) const;
  /// The same for paths in a row on which something is in the way at once.
  std::optional<std::string> why_refused() const;
  /// Whether so many are in a row that the robot rather touches what is in the way of its body.
  bool is_refused_often() const;

 private:
  double idle_way(double driven) const;

  double most_idle_;
  DiscoveredFloor discovered_;
  // What counts as driven without progress; where the newest way began, and progress ended [m].
  double idle_distance_ = 0.0, way_begin_ = 0.0, useful_distance_ = 0.0;
  int empty_decisions_ = 0, refused_paths_ = 0, idle_ = 0, collisions_ = 0;  // in a row
};

}  // namespace cairn
