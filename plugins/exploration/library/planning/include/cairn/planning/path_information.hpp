// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/joint_objective.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// What a loop closure does to the covariances of the other poses: `exact` updates all of them
/// (matrix determinant lemma; Kopitkov and Indelman, IJRR 2017); `thesis` interpolates the ratios
/// of their determinants along the loop (J. Vallvé, thesis, 5.15 and 5.16).
enum class LoopForm { exact, thesis };
constexpr auto enum_names(LoopForm) {
  return std::to_array<EnumName<LoopForm>>(
      {{LoopForm::exact, "exact"}, {LoopForm::thesis, "thesis"}});
}

struct PathInformationOptions {
  LoopForm loops = LoopForm::exact;
  EntropyForm entropy = EntropyForm::standard;
  /// Which a loop closure must exceed to be made [nats]; negative: `MatchModel::loop_gain`.
  double loop_gain = -1.0;
  double memory = 32.0;  ///< [MB], for covariances that paths with common beginnings share
  /// By which `estimated_trajectory_change` estimates the change of all poses of the graph, at
  /// most; 0: by all.
  int sampled_poses = 128;

  static auto fields() {
    using O = PathInformationOptions;
    return OptionFields<O>()
        .choice("loops", &O::loops,
                "covariances after a loop closure: exact, or interpolated as in the thesis (5.16)")
        .choice("entropy", &O::entropy,
                "of a Gaussian: standard is ½ ln((2πe)ⁿ|Σ|), thesis lacks the root of |Σ|")
        .real("loop_gain", &O::loop_gain, -1.0, 1e9,
              "information gain that a loop closure on a path must exceed to be expected [nats]; "
              "negative: that of the policy")
        .real("memory", &O::memory, 0.0, 1e6,
              "for covariances that paths with common beginnings share [MB]; what does not fit "
              "is computed again")
        .integer("sampled_poses", &O::sampled_poses, 0, 2147483647,
                 "poses of the graph by which the change of all is estimated where paths are only "
                 "compared, at most; 0: all");
  }
};

/// What paths are expected to do to the covariances of a pose graph in the plane.
///
/// Made once per decision from the estimator, of which it takes the diagonal blocks of Σ and the
/// column of the newest pose; columns of poses with which a path closes a loop are taken when they
/// are first needed. Then paths are built motion by motion:
///
///     PathInformation information(situation);
///     PathInformation::State state = information.start();
///     for (const Pose2& motion : motions) state = information.extended(state, motion);
///     state.trajectory_change();
///
/// A state is a shared pointer to immutable data, so that any number of paths may go on from one
/// (a tree of paths). It must not outlive the `PathInformation`, which is not for several threads
/// at once.
///
/// Every motion adds a pose by odometry (thesis, 5.14). If it lies in the match area of a pose of
/// the graph, a loop is closed: with the pose that makes the new pose's |Σ| least, of those whose
/// information gain ½ ln(|S| / |R|) exceeds `loop_gain`; S = J Σ Jᵀ + R is the innovation's
/// covariance, with all that the path has closed before, R the covariance of a match. Poses that
/// can be matched with where the robot is already are left out: that needs no path. With
/// `loops=thesis` no cross-covariances are used: Σ of the new pose is that of the old one and the
/// match, and the gain is half the decrease of ln |Σ|.
class CAIRN_API PathInformation {
 public:
  /// Whether a pose at `newer` can be matched with one at `older`, besides being in its match area
  /// (walls between them, for instance).
  using CanMatch = std::function<bool(const Pose2& older, const Pose2& newer)>;
  struct Node;

  /// A path from where the robot is.
  class State {
   public:
    const Pose2& pose() const;  ///< at its end
    int steps() const;          ///< motions
    double length() const;      ///< [m]
    /// Of the pose at its end, on its right tangent, with the prior of the first pose of the graph
    /// (`Situation::first_sigma`).
    Eigen::Matrix3d covariance() const;
    /// The change of the trajectory's entropy, the mean of that of its poses (thesis, 5.13):
    /// (1/k) Σ_{i≤k} h(Σ'_ii) − (1/n) Σ_{i≤n} h(Σ_ii), n poses now and k with the path [nats].
    double trajectory_change() const;
    /// The same, but the poses of the graph that loop closures change are estimated by
    /// `sampled_poses` of them, each of which stands for a part of the trajectory. The time for
    /// their marginals does not grow with the graph.
    double estimated_trajectory_change() const;
    /// ln |Λ'| − ln |Λ| of the graph's information matrix [twice nats]: of odometry Σ ln |Q⁻¹|,
    /// the units of which depend on those of the poses, and of loop closures Σ ln(|S| / |R|).
    double odometry_log_determinant() const;
    /// With `loops=thesis` −Σ ln ρ of the poses that close loops, which is less.
    double loop_log_determinant() const;
    int loops() const;  ///< closed on the path
    /// The pose with which the pose at its end closes a loop, if it does.
    std::optional<Id> closes_with() const;
    /// The path up to the motion before; the start is its own.
    State before() const;

   private:
    friend class PathInformation;
    explicit State(std::shared_ptr<const Node> node) : node_(std::move(node)) {}
    std::shared_ptr<const Node> node_;
  };

  /// Throws `Error` (usage) without poses, (numerical) where the covariances do not exist. The
  /// robot may be at some distance from the last of the poses that are kept: then its motion from
  /// there has the covariance of odometry.
  explicit PathInformation(const Situation& situation, const PathInformationOptions& options = {},
                           CanMatch can_match = {});
  PathInformation(PathInformation&&) noexcept;
  PathInformation& operator=(PathInformation&&) noexcept;
  ~PathInformation();

  /// The path without a motion.
  State start() const;
  /// One motion more, in the frame of the pose before, with the noise of the robot's odometry.
  State extended(const State& path, const Pose2& motion);
  State extended(State path, std::span<const Pose2> motions);

  /// (1/n) Σ ln|Σ_ii| of the graph now, as an entropy (thesis, 5.13) [nats].
  double trajectory_entropy() const;
  int poses() const;  ///< of the graph

 private:
  class Model;
  std::unique_ptr<Model> model_;
};

}  // namespace cairn
