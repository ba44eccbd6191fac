// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/joint_objective.hpp"
#include "cairn/planning/seen_cells.hpp"
#include "cairn/planning/simulated_graph.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

class MatchIndex;

struct PathSimulationOptions {
  EntropyForm entropy = EntropyForm::standard;
  /// Which a loop closure must exceed to be made [nats]; negative: `MatchModel::loop_gain`.
  double loop_gain = -1.0;
  double simulated_range = 4.0;  ///< of the lidar, in what is unknown [m]

  static auto fields() {
    using O = PathSimulationOptions;
    return OptionFields<O>()
        .choice("entropy", &O::entropy,
                "of a Gaussian: standard is ½ ln((2πe)ⁿ|Σ|), thesis lacks the root of |Σ|")
        .real("loop_gain", &O::loop_gain, -1.0, 1e9,
              "information gain that a loop closure on a path must exceed to be expected [nats]; "
              "negative: that of the policy")
        .real("simulated_range", &O::simulated_range, 0.1, 1000.0,
              "within which unknown floor is expected to be discovered [m]: between caution and "
              "the lidar's own range, which limits it");
  }
};

/// What a simulated drive has done.
struct SimulatedDrive {
  /// One loop closure: a pose of the graph, and one of the drive.
  struct Closure {
    Id older = 0, newer = 0;
    double gain = 0.0;  ///< information gain [nats]
  };

  double length = 0.0;  ///< [m]
  int motions = 0;
  std::vector<Closure> closures;
  std::size_t cells = 0;     ///< unknown ones that it discovers
  InformationChange change;  ///< with α = 1
  std::vector<Id> poses;     ///< of the graph afterwards

  double value() const { return change.trajectory + change.map; }
};

/// Simulates drives on copies of the pose graph, motion by motion, as SLAM would carry them out
/// (Active Pose SLAM: R. Valencia, J. Valls Miró, G. Dissanayake and J. Andrade-Cetto, IROS 2012):
///
///     ΔH = H(x') − H(x) + H(m') − H(m),
///
/// H(x) the mean entropy of the poses (thesis, 5.13) and H(m) that of the map (5.6), without a
/// weight α between the two. Every motion adds a pose by odometry. If it lies in the match area of
/// poses of the graph, from which no known obstacle hides it, a loop is closed with the one by
/// which the new pose's |Σ| becomes least, of those whose information gain ½ ln(|JΣJᵀ + R| / |R|)
/// exceeds `loop_gain`; Σ is that of the copy. Poses that can be matched with where the robot is
/// already are left out. ΔH(m) is −l² ln 2 for each cell that `SeenCells` discovers on the path.
///
/// `PathInformation` computes the same change of H(x) without a copy, by the determinant lemma.
class CAIRN_API PathSimulation {
 public:
  /// What the situation refers to, and the registry, must outlive it. Throws `Error` (usage)
  /// without poses, (numerical) where the graph has no covariances.
  PathSimulation(const Situation& situation, const PathSimulationOptions& options,
                 Registry& registry);

  SimulatedDrive drive(const PlannedPath& path) const;

 private:
  std::optional<SimulatedDrive::Closure> closure(SimulatedGraph& graph, MatchIndex& index,
                                                 const Pose2& at) const;

  const Situation& situation_;
  PathSimulationOptions options_;
  Registry& registry_;
  SeenCells seen_;
  std::vector<Pose2> poses_;  ///< of the graph
  double entropy_now_ = 0.0;  ///< (5.13) in the form of the thesis
};

}  // namespace cairn
