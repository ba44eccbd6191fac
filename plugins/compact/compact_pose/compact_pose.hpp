// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "absolute.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/update/pose_remover.hpp"
#include "compact_graph.hpp"
#include "compact_pose_options.hpp"
#include "consistency.hpp"
#include "landmarks.hpp"
#include "match_record.hpp"
#include "measured.hpp"
#include "proximity.hpp"
#include "relocation.hpp"
#include "threshold_finder.hpp"
#include "triangulation.hpp"

namespace cairn::compact {

/// Compact pose SLAM: Algorithm 1 of Ila, Polok, Solony and Svoboda, IJRR 2017, section 4.
///
/// A link is used if its information gain exceeds g_loop, expected and then measured; the most
/// informative first, after which the gains of the others are evaluated again. A pose is kept if it
/// got a link, or if the gain of linking it to any pose nearby (the previous one among them)
/// exceeds g_pose: then it is in a new place.
///
/// The gain of a link is never increased by another link. So the candidates' gains are upper bounds
/// once one was used: only that of the best is recomputed, until the best is up to date. The choice
/// is the same as if all were recomputed, as long as the linearisation is unchanged.
///
/// With `reuse`, which the paper does not have, a pose that is linked to a kept one is not kept
/// itself (`CompactGraph::relocate`): so the map of a place does not grow without end. Its error is
/// larger then.
///
/// With `keep`, which the paper does not have either, poses leave where there are more
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
  std::vector<Id> kept() const override { return graph_.kept(); }
  std::vector<Id> removed() const override { return removed_; }
  std::vector<Id> landmarks() const override { return graph_.landmarks(); }
  std::vector<Id> undetermined() const override;
  int factor_count() const override { return graph_.factor_count(); }
  std::optional<double> link_gain() const override { return std::max(loop_gain_, 0.0); }
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
  struct Candidate {
    int pose = 0;
    int version = 0;  ///< of the estimate with which the gain was computed
    double gain = 0.0;
    double worth = 0.0;  ///< by which candidates are proposed
    int place = 0;       ///< in `dimensions_`
  };
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

  /// What was learnt from a link that may be revoked.
  struct Learnt {
    Id earlier = 0, later = 0;
    Matrix covariance;
    double gain = 0.0;
    bool noted = false;  ///< by `finder_`
  };
  /// An absolute measurement that waits for others, and the report of it.
  struct WaitingPrior {
    AbsoluteMeasurement measurement;
    PriorReport report;
  };

  /// What was measured of a landmark.
  struct Seen {
    Variable landmark;
    std::vector<Measured> factors;
  };
  /// Where a single pose puts a landmark; without a state: it does not determine it.
  struct FirstPlace {
    std::optional<std::vector<double>> state;
    std::string problem;  ///< why it cannot be used; empty: it can
  };
  /// Of a landmark in the graph: of how many poses measurements were used, or refused by the gate.
  struct Agreement {
    int used = 0, refused = 0;
  };
  /// A landmark that is not in the graph, since nothing determines it so far, and what poses that
  /// are kept measure of it.
  struct WaitingLandmark {
    Variable landmark;
    std::vector<View> views;  ///< in the order of arrival; perhaps none
  };
  /// Where it is by some of the views, of these numbers.
  struct Triangulated {
    std::vector<std::size_t> chosen;
    Triangulation found;
  };

  void start(const Variable& pose);
  void check_new(const Variable& pose) const;
  void expect_matches();
  bool answered(int pose) const;
  /// So many matches that were proposed for the newest pose led to no link that others will hardly
  /// do so. Never where all loop closures are wanted, or a recording has them all.
  bool gives_up() const {
    return options_.attempts > 0 && in_vain_ >= options_.attempts &&
           options_.strategy != Strategy::apal && options_.search != Search::recorded;
  }
  /// Whether thresholds may be asked for (`OptionFinder::watching`): what they are found from takes
  /// memory for every pose and every loop closure, as the graph itself does then.
  bool watches() const { return options_.strategy == Strategy::apal && options_.keep == 0; }
  void search();
  bool looks_wide();
  void search_wide();
  std::vector<int> recorded_pairs() const;
  Displacement known_displacement(int pose);
  std::optional<Candidate> take_candidate(int pose);
  double expected_gain(int pose);
  bool silenced();
  double worth(int pose, double gain) const;
  /// The part of the match that ends the way, if the newest pose is to be relocated by this link.
  std::optional<double> relocation(const Link& link) const;
  void use(const Link& link);
  LinkVerdict judge(const Link& link, LinkReport& report);
  void judge_waiting();
  void follow_refused(const Motion& motion);
  bool doubts_odometry(const Link& link, const Displacement& expected);
  bool agrees_with_waiting(const Link& link);
  LinkVerdict judge_prior(const MeasuredFit& fit, PriorReport& report) const;
  FrameEstimate frame();
  bool find_frame();
  void settle_priors();
  MayUse may_use(std::function<bool(std::size_t, const Eigen::MatrixXd&)> linear) const;
  bool linear(Id landmark, Id pose, const PlacedState& x, std::span<const Measured> factors,
              const ObservationRows& rows, const Eigen::MatrixXd& joint) const;
  void use_landmarks();
  FirstPlace place(const Seen& seen) const;
  void release_contradicted();
  bool add_landmarks();
  WaitingLandmark with_newest(const Seen& seen) const;
  std::optional<Triangulated> triangulated(const WaitingLandmark& waiting);
  std::vector<PlacedView> placed_views(const WaitingLandmark& waiting,
                                       std::span<const std::size_t> chosen) const;
  std::optional<Triangulated> consensus_of(
      std::span<const std::size_t> places,
      const std::function<std::optional<Triangulated>(std::span<const std::size_t>)>& of) const;
  bool fits(const Triangulated& triangulated) const;
  bool agree(const Triangulated& some) const;
  void limit_waiting(Id newest);
  void add_triangulated(WaitingLandmark waiting, Triangulated triangulated);
  void judge_views(Id landmark, std::span<const View> views);
  void settle_landmark(Id landmark);
  bool use_waiting_landmarks();
  bool add_or_wait(const Seen& seen);
  void see(std::vector<Variable> added, std::span<const Factor> factors);
  void settle_left_out();
  bool may_wait(Id landmark) const;
  void wait_again(Id landmark, const View& view);
  bool has_waiting_views(Id pose) const;
  void forget_views(std::span<const Id> poses);
  void forget(Id a, Id b);
  std::optional<Id> cover(int pose);
  void limit_poses_of_landmarks(bool located);
  void note_leaving(const CompactGraph::Leaving& leaving);
  void make_room();

  CompactPoseOptions options_;
  std::unique_ptr<PoseRemover> remover_;
  SensorRange range_;
  CompactGraph graph_;
  std::optional<DistanceTest> test_;
  std::optional<ConsistencyCheck> check_;
  /// With `Search::recorded`, by pose: the others of which the recording has a measurement; none
  /// without a recording.
  std::optional<std::unordered_map<Id, std::vector<Id>>> recorded_;
  double radius_ = 0.0;  ///< no pose farther away can be a candidate [m]
  double driven_ = 0.0;  ///< since all kept poses were tested last, by odometry [m]
  Matrix sensor_;        ///< Σ̄_y, if it was given; else that of `typical_`
  double loop_gain_ = 0.0, pose_gain_ = 0.0, prior_gain_ = 0.0;  // [nats]
  double landmark_gain_ = 0.0, landmark_loss_ = 0.0;             // [nats]

  // The newest pose:
  PoseReport report_;
  Matrix odometry_;  ///< covariance of its odometry from the previous pose, kept or not
  Matrix expected_;  ///< Σ̄_y
  std::vector<Seen> seen_;
  bool open_ = false, searched_ = false;
  std::vector<Candidate> candidates_;  ///< a heap by worth
  int answered_ = 0;                   ///< requests for a match
  int in_vain_ = 0;                    ///< proposed ones that are inconsistent or wait, in a row
  int proposed_ = -1;                  ///< the pose that was proposed last; −1: none
  int solved_version_ = -1;            ///< of the graph when candidates were last solved for
  int asked_version_ = -1;             ///< of the graph when a single candidate was evaluated again
  std::vector<Dimensions> dimensions_;  ///< of the candidates, before any link of this pose

  std::vector<Waiting> waiting_;
  std::deque<Refused> refused_;  ///< the latest
  std::vector<WaitingPrior> waiting_priors_;
  std::map<Id, WaitingLandmark> waiting_landmarks_;
  int nonlinear_poses_ = 0;  ///< in a row, of which no measurement of a landmark was linear
  std::unordered_map<Id, Agreement> agreement_;  ///< with a gate
  std::unordered_map<Id, int> removals_;         ///< how often landmarks have left the graph
  ThresholdFinder finder_;                       ///< has nothing unless this `watches`
  double noise_scale_ = 1.0;                     ///< at the end, where this `watches`
  TypicalMatch typical_;
  MatchRecord record_;
  std::deque<Learnt> learnt_;  ///< of the latest links
  std::vector<Id> removed_;    ///< with the latest pose
  std::string noted_;          ///< why poses could not leave, when it was last reported
};

}  // namespace cairn::compact
