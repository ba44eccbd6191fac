// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/exploration/path_planner.hpp"
#include "cairn/exploration/world.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn {

/// What an explorer decides upon.
struct Situation {
  Estimator& estimator;       ///< only to be read, which changes no later result
  std::span<const Id> poses;  ///< those that are kept, in the order of arrival
  Pose2 pose;                 ///< where the robot is, as estimated
  const FloorMap& map;
  const RobotModel& robot;
  int decision = 0;  ///< how many came before
};

/// A path that was considered.
struct Candidate {
  PlannedPath path;
  double value = 0.0;  ///< by which they are compared: the least is best
  std::string what;    ///< "frontier of 3.2 m"
};

struct Decision {
  enum class Kind {
    drive,     ///< along `candidates[chosen]`
    finished,  ///< nothing is left
    stuck      ///< something is left, and there is no path to it
  };
  Kind kind = Kind::drive;
  std::string why;  ///< a sentence
  std::vector<Candidate> candidates;
  std::size_t chosen = 0;
  std::vector<std::string> notes;
};

/// Chooses where a robot drives next to explore a floor.
class CAIRN_API Explorer : public Component {
 public:
  static constexpr std::string_view kKind = "explorer";
  ~Explorer() override;

  /// Called before the first decision of a run.
  virtual void begin(std::uint64_t seed) = 0;
  virtual Decision decide(const Situation& situation) = 0;
  /// Called after each motion along a path that it has chosen: false if what it led to is known by
  /// now, so that it decides anew. Unless overridden, every path is driven to its end.
  virtual bool is_worthwhile(const Situation& situation, const PlannedPath& path);
};

}  // namespace cairn
