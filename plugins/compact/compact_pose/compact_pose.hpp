// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absolute_selection.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/update/pose_remover.hpp"
#include "compact_graph.hpp"
#include "compact_pose_options.hpp"
#include "landmark_selection.hpp"
#include "loop_selection.hpp"

namespace cairn::compact {

/// Compact pose SLAM: Algorithm 1 of Ila, Polok, Solony and Svoboda, IJRR 2017, section 4.
///
/// What is measured is judged by what it adds: loop closures (`LoopSelection`), absolute
/// measurements (`AbsoluteSelection`) and those of landmarks (`LandmarkSelection`). A pose is kept
/// if something that it measured is used, or if the gain of linking it to any pose nearby (the
/// previous one among them) exceeds g_pose: then it is in a new place.
///
/// With `keep`, which the paper does not have, poses leave where there are more
/// (`CompactGraph::make_room`): so no map grows without end, however large the place is.
class CompactPose final : public PosePolicy, public OptionFinder {
 public:
  /// `remover` is null if any number of poses is kept (`CompactPoseOptions::keep`).
  CompactPose(std::unique_ptr<Estimator> estimator, CompactPoseOptions options,
              std::unique_ptr<PoseRemover> remover = nullptr);

  void expect(const Graph& recording, std::span<const Arrival> poses) override;
  void load(const Graph& map) override;
  std::vector<Id> unlocated() const override;
  void add_pose(const Variable& pose, std::span<const Factor> odometry) override;
  std::optional<MatchProposal> next_match() override;
  LinkReport offer(Id other, std::span<const Factor> measured) override;
  PriorReport offer_prior(const Factor& measured) override;
  bool takes_landmarks() const override { return true; }
  void offer_landmark(const LandmarkObservation& observation) override;
  bool revoke(Id a, Id b) override;
  PoseReport end_pose() override;
  bool finish() override;

  Estimator& estimator() override { return graph_.estimator(); }
  std::vector<Id> kept() const override { return graph_.kept().ids(); }
  std::vector<Id> removed() const override { return removed_; }
  std::vector<Id> landmarks() const override { return graph_.landmarks().ids(); }
  std::vector<Id> undetermined() const override { return landmarks_.waiting().ids(); }
  int factor_count() const override { return graph_.factor_count(); }
  std::optional<double> link_gain() const override { return std::max(gains_.loop, 0.0); }
  std::vector<double> newest_state() const override;
  const std::vector<OdometryChain>& chains() const override { return graph_.chains(); }
  void keep_chains(bool keep) override { graph_.keep_chains(keep); }

  void* ability(std::string_view name) override;
  OptionValues watching(bool recorded_only) const override;
  OptionValues found() const override;
  /// `loop_gain` and `pose_gain` times the factors.
  OptionValues scaled(const OptionValues& found, double links, double poses) const override;
  double accuracy() const override;

 private:
  void start(const Variable& pose);
  void advance(const Variable& pose, std::span<const Factor> odometry);
  void check_new(const Variable& pose) const;
  void settle_pose();
  std::optional<Id> cover(int pose);
  void limit_poses_of_landmarks(bool located);
  void note_leaving(const CompactGraph::Leaving& leaving);
  void make_room();

  CompactPoseOptions options_;
  std::unique_ptr<PoseRemover> remover_;
  Gains gains_;
  CompactGraph graph_;
  LoopSelection loops_;
  AbsoluteSelection absolute_;
  LandmarkSelection landmarks_;

  PoseReport report_;  ///< of the newest pose
  bool open_ = false;
  std::vector<Id> removed_;   ///< with the latest pose
  std::string noted_;         ///< why poses could not leave, when it was last reported
  double noise_scale_ = 1.0;  ///< at the end, where thresholds may be asked for
};

}  // namespace cairn::compact
