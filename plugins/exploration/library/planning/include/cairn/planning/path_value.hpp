// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/joint_objective.hpp"
#include "cairn/planning/path_information.hpp"
#include "cairn/planning/rrt_star.hpp"
#include "cairn/planning/seen_cells.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

struct PathValueOptions {
  /// With α as the ratio of mean variances, which is the power 1/3: with `alpha=end` and power 1 it
  /// varies by four orders of magnitude among the paths of one tree, and then decides alone.
  JointObjectiveOptions objective = {.power = 1.0 / 3.0};
  /// Its form of the entropy is that of the objective, whatever stands here.
  PathInformationOptions information;
  double simulated_range = 4.0;  ///< of the lidar, in what is unknown [m]

  static auto fields() {
    using O = PathValueOptions;
    using I = PathInformationOptions;
    return OptionFields<O>()
        .real("simulated_range", &O::simulated_range, 0.1, 1000.0,
              "within which unknown floor is expected to be discovered [m]: between caution and "
              "the lidar's own range, which limits it")
        .part(&O::objective)
        .part(&O::information,
              OptionFields<I>()
                  .choice("loops", &I::loops,
                          "covariances after a loop closure: exact, or interpolated as in the "
                          "thesis (5.16), which expects too much once the graph has loops")
                  .real("loop_gain", &I::loop_gain, -1.0, 1e9,
                        "information gain that a loop closure on a path must exceed to be expected "
                        "[nats]; negative: that of the policy")
                  .real("memory", &I::memory, 0.0, 1e6,
                        "for covariances that paths with common beginnings share [MB]")
                  .integer("sampled_poses", &I::sampled_poses, 0, 2147483647,
                           "poses of the graph by which the change of all is estimated while a "
                           "tree grows, at most; the best paths are evaluated with all; 0: all"));
  }
};

/// What a path is worth: the change of the joint entropy of trajectory and map that it is expected
/// to bring, per metre (thesis, 5.10),
///
///     (ΔH(x) + α ΔH(m)) / max(length, a step of the robot),
///
/// with ΔH(x) by `PathInformation`, ΔH(m) by `SeenCells`, and both joined by `JointObjective`.
/// Below zero is a decrease. (A path shorter than a step counts as one: turning on the spot is not
/// free.) Every motion that the robot makes on the path is a pose. Loops are closed only with poses
/// that no known obstacle hides. Cells are discovered by the scans at these poses, but for those
/// between two that overlap: on a turn on the spot, and within a step along arcs.
///
/// It is a `PathCost`, for `RrtStar`: in a tree ΔH(x) is estimated
/// (`PathInformation::State::estimated_trajectory_change`), and `evaluated` has the exact value.
class CAIRN_API PathValue {
 public:
  /// The last segment of a path.
  struct Segment {
    Pose2 start;
    std::vector<Pose2> motions;  ///< each in the frame of the pose before
    CellWindow seen;             ///< from their ends
  };
  struct State {
    PathInformation::State information;
    std::shared_ptr<const Segment> segment = {};  ///< none: the path without a segment
    std::shared_ptr<const CellSet> seen = {};     ///< on the whole path, once adopted
    std::size_t cells = 0;                        ///< how many it discovers
    InformationChange change = {};
    double value = 0.0;     ///< [nats/m]
    bool is_exact = false;  ///< else ΔH(x) is estimated
  };

  /// `left_out`: points [m] whose cells do not count as discovered. The situation, and what it
  /// refers to, must outlive it. Throws as `PathInformation` does.
  explicit PathValue(const Situation& situation, const PathValueOptions& options = {},
                     std::span<const Eigen::Vector2d> left_out = {});

  State root(const Eigen::Vector2d& point) const;
  State extended(const State& path, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                 const State* before);
  State adopted(State path, const State& parent) const;
  double value(const State& path) const { return path.value; }
  /// The same path with its exact value.
  State evaluated(State path) const;

  const SeenCells& seen_cells() const { return seen_; }

 private:
  std::shared_ptr<const Segment> segment(const Pose2& start, const Eigen::Vector2d& to,
                                         const State* before) const;
  void evaluate(State& path, double trajectory_change) const;

  const Situation& situation_;
  JointObjective objective_;
  PathInformation information_;
  SeenCells seen_;
  Eigen::Matrix3d now_;  ///< covariance of the robot's pose
  double map_now_;       ///< entropy [nats·m²]; only where the objective needs it
};

/// The values of all paths of a tree, estimated as in a tree that is grown for them, by node, nodes
/// nearer to the root (in segments) first. Those that were not evaluated within `seconds`, or
/// before `interrupt`, if not null, became true, are none.
template <class Cost>
std::vector<std::optional<PathValue::State>> path_values(
    const RrtStar<Cost>& tree, PathValue& value,
    double seconds = std::numeric_limits<double>::infinity(),
    const std::atomic<bool>* interrupt = nullptr) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  const auto at = [](int node) { return static_cast<std::size_t>(node); };
  const auto& nodes = tree.nodes();
  std::vector<std::optional<PathValue::State>> values(nodes.size());
  values.front() = value.root(nodes.front().point);
  std::vector<int> order{0};
  for (std::size_t head = 0; head < order.size(); ++head) {
    const auto& above = nodes[at(order[head])];
    const PathValue::State& path = *values[at(order[head])];
    for (const int child : above.children) {
      if (interrupt && interrupt->load(std::memory_order_relaxed)) return values;
      if (std::chrono::duration<double>(Clock::now() - start).count() > seconds) return values;
      values[at(child)] =
          value.adopted(value.extended(path, above.point, nodes[at(child)].point, nullptr), path);
      order.push_back(child);
    }
  }
  return values;
}

}  // namespace cairn
