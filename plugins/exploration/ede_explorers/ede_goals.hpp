// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/entropy_field.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "given_up_frontiers.hpp"

namespace cairn::exploration {

struct EdeGoalsOptions {
  EntropyFieldOptions field = {};
  double smallest = 0.0;
  int revisits = 3;

  static auto fields() {
    using O = EdeGoalsOptions;
    return OptionFields<O>()
        .part(&O::field)
        .real("smallest", &O::smallest, 0.0, 1000.0,
              "shorter frontiers do not count [m]; 0: shorter than the robot is wide")
        .integer("revisits", &O::revisits, 0, 1000000,
                 "so many goals in a row may be loop closures without any floor discovered; then "
                 "frontiers alone count; 0: any number, as in the thesis");
  }
};

/// The entropy field of a situation, without what has been sought in vain, and the part of it that
/// the robot can reach.
struct ReachableField {
  std::vector<BeamCell> cells;
  std::unique_ptr<EntropyField> field;
  std::vector<float> lengths;   ///< of paths, by cell of the configuration space [m]
  std::vector<char> reachable;  ///< by cell of the configuration space
  bool discovers = false;       ///< a frontier is in sight of some configuration that is reachable
  bool coarse = false;          ///< of fewer directions and orientations than asked for
};

/// Of a decision by a field that is coarse.
inline constexpr const char* kCoarseNote =
    "fields had fewer directions and orientations, for the time budget";

/// What both explorers share: the field at a decision, and what became of the goal before.
///
/// The configuration with the least E may be one at which nothing happens: a frontier that stays
/// one though the lidar has seen it, a loop closure that the policy does not want. Frontier cells
/// that were in sight of a goal, and are there still once the robot has been there, or has tried
/// several times, are given up until the map around them changes; and loop closures count no more
/// after several in a row without a discovery.
class EdeGoals {
 public:
  explicit EdeGoals(const EdeGoalsOptions& options) : options_(options) {}

  void begin();
  /// For a decision. `tight`: through gaps that may be a cell narrower than the body. Where more
  /// than `seconds` are expected, by what the last one took, there are a half or a quarter of the
  /// directions of beams and of the orientations, unless no frontier would then be in sight.
  ReachableField field(const Situation& situation, bool tight, double seconds);
  /// Gives up what is in sight of a configuration; and it counts as a revisit.
  void give_up(const Situation& situation, const ReachableField& at, std::size_t configuration);
  /// The robot drives to a configuration, of the field's space.
  void chosen(const ReachableField& at, std::size_t configuration);
  /// Whether as much as half of the frontier cells that were in sight of the goal are there still,
  /// if it was chosen for them.
  bool is_worthwhile(const Situation& situation) const;

  /// "no frontier of 0.4 m or more is in sight of where it can drive".
  std::string end_text(const Situation& situation) const;

 private:
  struct Goal {
    Pose2 pose;
    double seen = 0.0;      ///< frontier cells in sight of it
    bool discovers = true;  ///< chosen rather for the map than for the trajectory
    int tries = 1;          ///< decisions in a row for about the same goal
  };

  void review_goal(const Situation& situation);
  ReachableField field_with(const Situation& situation, bool tight, int part);
  double smallest(const Situation& situation) const;

  EdeGoalsOptions options_;
  GivenUpFrontiers given_up_;
  std::optional<Goal> goal_;
  double coverage_ = 0.0;   ///< at the last discovery [m²]
  int revisits_ = 0;        ///< since then
  bool tight_ = false;      ///< as the last field
  double beam_cell_ = 0.0;  ///< what a field has taken per cell of the map and direction [s]
};

/// A situation, but for another robot or time budget.
Situation adapted(const Situation& situation, const RobotModel& robot, double budget);

/// The situation of a robot that is a cell narrower, as far as that is above half its radius.
RobotModel narrowed(const RobotModel& robot, const GridFrame& frame);

/// A decision that ends the run.
Decision end_decision(Decision::Kind kind, std::string why);

/// Whether driving along a path takes a motion.
bool moves(const Situation& situation, const PlannedPath& path);

}  // namespace cairn::exploration
