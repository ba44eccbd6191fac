// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "absolute.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "compact_graph.hpp"
#include "consistency.hpp"

namespace cairn::compact {

/// Which absolute measurements of poses are used: judged by what they add, as links are. Where
/// nothing absolute is in the graph yet, they wait until they determine together where it is.
class AbsoluteSelection {
 public:
  AbsoluteSelection() = default;
  /// `least_gain`: of one that is used [nats].
  AbsoluteSelection(double least_gain, Gate gate) : least_gain_(least_gain), gate_(gate) {}

  /// One of the newest pose, which is kept if it is used, or waits. Throws `Error` (input) for a
  /// factor that is not on that pose alone, and while it is unknown where it is on the map.
  PriorReport judge(const Factor& measured, CompactGraph& graph, PoseReport& report);
  /// After a pose was fixed nothing has to wait.
  void settle(CompactGraph& graph, PoseReport& report);
  /// The poses whose measurements wait.
  std::vector<int> held(const CompactGraph& graph) const;

 private:
  /// One that waits for others, and the report of it.
  struct Waiting {
    AbsoluteMeasurement measurement;
    PriorReport report;
  };

  LinkVerdict verdict(const MeasuredFit& fit, PriorReport& outcome) const;
  FrameEstimate frame(CompactGraph& graph, PolicySeconds& seconds) const;
  bool find_frame(CompactGraph& graph, PoseReport& report);

  double least_gain_ = 0.0;
  Gate gate_;
  std::vector<Waiting> waiting_;
};

}  // namespace cairn::compact
