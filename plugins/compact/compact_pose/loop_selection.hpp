// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "cairn/policy/pose_policy.hpp"
#include "candidate_search.hpp"
#include "compact_graph.hpp"
#include "compact_pose_options.hpp"
#include "consistency.hpp"
#include "match_statistics.hpp"

namespace cairn::compact {

/// Which loop closures are used: lines 14 to 23 of Algorithm 1.
///
/// A link is used if its information gain exceeds g_loop, expected and then measured; the most
/// informative first, after which the gains of the others are evaluated again. With a gate it must
/// fit the estimate too, and where that proves little it waits until another one agrees with it.
///
/// With `reuse`, which the paper does not have, a pose that is linked to a kept one is not kept
/// itself (`CompactGraph::relocate`): so the map of a place does not grow without end. Its error is
/// larger then.
class LoopSelection {
 public:
  explicit LoopSelection(const CompactPoseOptions& options) : options_(options), search_(options) {}

  void expect(const Graph& recording, std::span<const Arrival> poses) {
    search_.expect(recording, poses);
  }
  /// The first pose; `sensor` as the options have it.
  void begin(const RigidGroup& group, const Gains& gains, Matrix sensor);
  /// The next pose.
  void advance(const Motion& motion, const RigidGroup& group);
  /// No match of the newest pose was asked for so far.
  void begin_pose() { search_.begin_pose(); }
  std::optional<MatchProposal> next_match(CompactGraph& graph, PoseReport& report) {
    return search_.next(graph, matches_, report);
  }
  /// What was measured from a kept pose to the newest, fused to `motion`; no factors: they do not
  /// match. Uses the link, if it is to be used, and those that waited for it.
  LinkReport judge(int pose, std::span<const Factor> measured, const Motion& motion,
                   CompactGraph& graph, PoseReport& report);
  /// The link of two poses was false, and has left the graph if it was there: false if it was not,
  /// and did not wait either.
  bool forget(Id a, Id b, bool was_there, const CompactGraph& graph);
  /// … while the newest pose is open: others gain more without it.
  void restart(PoseReport& report) { search_.restart(report); }
  /// No more links of the newest pose come.
  void end_pose(CompactGraph& graph, PoseReport& report);

  /// Kept poses of the links that wait.
  std::vector<int> held() const;
  /// Poses have left: pose k has the number `now[k]` now.
  void renumber(std::span<const int> now);
  const CandidateSearch& search() const { return search_; }
  const ThresholdFinder& thresholds() const { return matches_.thresholds(); }
  /// Whether thresholds may be asked for (`OptionFinder::watching`): what they are found from takes
  /// memory for every pose and every loop closure, as the graph itself does then.
  bool watches() const { return options_.strategy == Strategy::apal && options_.keep == 0; }

 private:
  /// A link that waits for another one to agree, and the pose that it was measured for.
  struct Waiting {
    Link link;
    LinkReport report;
  };
  /// A link that the gate has refused, and how the robot has moved since its later pose.
  struct Refused {
    Id earlier = 0, later = 0;
    Link link;
    Displacement since;
  };

  LinkVerdict verdict(const Link& link, LinkReport& outcome, CompactGraph& graph,
                      PoseReport& report);
  void wait(Link link, const LinkReport& outcome, CompactGraph& graph, PoseReport& report);
  void follow_refused(const Motion& motion, const RigidGroup& group);
  bool doubts_odometry(const Link& link, const Displacement& expected, CompactGraph& graph,
                       PoseReport& report);
  bool agrees_with_waiting(const Link& link, CompactGraph& graph, PoseReport& report);
  std::optional<double> relocation(const Link& link, const CompactGraph& graph,
                                   const PoseReport& report) const;
  void use(const Link& link, CompactGraph& graph, PoseReport& report);
  std::optional<LinkVerdict> verdict_now(Waiting& old, CompactGraph& graph);
  void judge_waiting(CompactGraph& graph, PoseReport& report);

  CompactPoseOptions options_;
  double loop_gain_ = 0.0, pose_gain_ = 0.0;  // [nats]
  CandidateSearch search_;
  MatchStatistics matches_;
  std::optional<ConsistencyCheck> check_;
  std::vector<Waiting> waiting_;
  std::deque<Refused> refused_;  ///< the latest
};

}  // namespace cairn::compact
