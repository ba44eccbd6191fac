// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "cairn/policy/pose_policy.hpp"
#include "compact_graph.hpp"
#include "compact_pose_options.hpp"
#include "consistency.hpp"
#include "observations.hpp"
#include "waiting_landmarks.hpp"

namespace cairn::compact {

/// Which measurements of landmarks are used, and which landmarks are in the graph. What the newest
/// pose measures is gathered, and judged when the pose ends: of landmarks in the graph by the
/// information gain, the most informative first; others are added where they are determined, if
/// the pose is kept.
class LandmarkSelection {
 public:
  LandmarkSelection() = default;
  LandmarkSelection(const CompactPoseOptions& options, double least_gain)
      : everything_(options.strategy == Strategy::apal),
        least_gain_(least_gain),
        gate_{options.gate},
        waiting_(options) {}

  void begin_pose() { seen_.clear(); }
  /// Of the newest pose. Throws `Error` (input) for what is not a measurement of a landmark.
  void offer(const LandmarkObservation& observation, const CompactGraph& graph);

  // When the pose ends, one after the other -------------------------------------------------------
  /// Measurements of landmarks in the graph; the newest pose is kept if one is used.
  void use_known(CompactGraph& graph, PoseReport& report);
  /// With what the newest pose measures, landmarks may be determined that were not: if the poses
  /// learn enough by that, it is kept. Whether one was added.
  bool use_waiting(CompactGraph& graph, PoseReport& report);
  /// Those that the newest pose, if it is kept, sees first. Whether there are any.
  bool add_new(CompactGraph& graph, PoseReport& report);

  /// Landmarks, or what was measured of them, have left the graph, since with them there was no
  /// covariance. To be called after each change of the graph that may come to this.
  void settle_left_out(CompactGraph& graph, PoseReport& report);
  /// What poses that have left measured waits no more.
  void forget(std::span<const Id> poses, PoseReport& report) { waiting_.forget(poses, report); }
  const WaitingLandmarks& waiting() const { return waiting_; }

 private:
  /// What was measured of a landmark.
  struct Seen {
    Variable landmark;
    std::vector<Measured> factors;
  };
  /// Where a single pose puts a landmark; without a state: it does not determine it.
  struct FirstPlace {
    std::optional<std::vector<double>> state{};
    std::string problem{};  ///< why it cannot be used; empty: it can
  };
  /// Of a landmark in the graph: of how many poses measurements were used, or refused by the gate.
  struct Agreement {
    int used = 0, refused = 0;
  };
  /// What the newest pose measures of landmarks in the graph.
  struct Known {
    std::vector<std::size_t> places;    ///< in `seen_`
    std::vector<ObservationRows> rows;  ///< of these
    std::vector<Id> landmarks;
    std::vector<int> sizes;  ///< of these
  };

  Known known(const CompactGraph& graph) const;
  std::vector<ObservationFit> choose(const Known& known, CompactGraph& graph,
                                     PolicySeconds& seconds) const;
  void note_fits(const Known& known, std::span<const ObservationFit> fits);
  MayUse may_use(std::function<bool(std::size_t, const Eigen::MatrixXd&)> linear) const;
  void release_contradicted(CompactGraph& graph, PoseReport& report);
  FirstPlace place(const Seen& seen, const CompactGraph& graph) const;
  bool add_or_wait(const Seen& seen, CompactGraph& graph, PoseReport& report);
  void add_triangulated(WaitingLandmark waiting, Triangulated triangulated, CompactGraph& graph,
                        PoseReport& report);
  void judge_views(Id landmark, std::span<const View> views, CompactGraph& graph,
                   PoseReport& report);
  void see(std::vector<Variable> added, std::span<const Factor> factors, CompactGraph& graph,
           PoseReport& report);

  bool everything_ = false;  ///< is used
  double least_gain_ = 0.0;  ///< of a measurement [nats]
  Gate gate_;
  std::vector<Seen> seen_;  ///< by the newest pose
  WaitingLandmarks waiting_;
  int nonlinear_poses_ = 0;  ///< in a row, of which no measurement of a landmark was linear
  std::unordered_map<Id, Agreement> agreement_;  ///< with a gate
};

}  // namespace cairn::compact
