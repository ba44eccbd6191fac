// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "cairn/exploration/explorer.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// A copy of a pose graph to which the poses and loop closures of a path are added, all measured as
/// they are expected: the graph that SLAM would have after the drive. The estimator of the
/// situation is not changed.
///
///     SimulatedGraph graph(situation, registry);
///     graph.add(pose);              // and odometry from the pose before
///     graph.close(older);           // a loop closure of that pose
///     graph.update();               // takes in what was added
///     trajectory_entropy(graph.estimator(), graph.poses(), situation.first_sigma);
class CAIRN_API SimulatedGraph {
 public:
  /// Copies the estimator. A robot at some distance from the last pose that is kept gets a pose
  /// where it is. `registry`: of the types of poses and factors. What the situation refers to must
  /// outlive it.
  SimulatedGraph(const Situation& situation, Registry& registry);

  /// A pose, with odometry from the one before, whose noise is that of the robot. Its id.
  Id add(const Pose2& pose);
  /// A loop closure between a pose of the situation's graph and the one that was added last, with
  /// the noise of a match.
  void close(Id older);
  /// Takes in what was added since the last call.
  void update();

  Estimator& estimator() { return *estimator_; }
  /// Those of the situation, and the ones that were added.
  const std::vector<Id>& poses() const { return poses_; }

 private:
  const Situation& situation_;
  Registry& registry_;
  std::unique_ptr<Estimator> estimator_;
  std::vector<Id> poses_;
  GraphUpdate pending_;
  Id next_ = 0;
  Pose2 at_;  ///< the last one
};

}  // namespace cairn
