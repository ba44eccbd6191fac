// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "cairn/policy/pose_policy.hpp"
#include "compact_graph.hpp"
#include "compact_pose_options.hpp"
#include "match_statistics.hpp"
#include "proximity.hpp"

namespace cairn::compact {

/// An earlier pose that the newest may see.
struct Candidate {
  int pose = 0;
  int version = 0;  ///< of the estimate with which the gain was computed
  double gain = 0.0;
  double worth = 0.0;  ///< by which candidates are proposed
  int place = 0;       ///< see `CandidateSearch::dimensions`
};

/// Which earlier poses the newest may see, and in which order they are proposed: lines 14 to 17 of
/// Algorithm 1.
///
/// The gain of a link is never increased by another link. So the candidates' gains are upper bounds
/// once one was used: only that of the best is recomputed, until the best is up to date. The choice
/// is the same as if all were recomputed, as long as the linearisation is unchanged.
class CandidateSearch {
 public:
  explicit CandidateSearch(CompactPoseOptions options) : options_(std::move(options)) {}

  /// Before the first pose: with `Search::recorded`, what the recording has measurements of.
  void expect(const Graph& recording, std::span<const Arrival> poses);
  /// Throws `Error` (usage) if there should have been a recording.
  void check_recording() const;
  /// The first pose, of that group. `sensor`: Σ̄_y, if it was given; else matches are expected to
  /// be as those before. A candidate is proposed if it gains more than `least_gain` [nats].
  void begin(const RigidGroup& group, double least_gain, Matrix sensor);
  /// The next pose: by odometry with this covariance, over a distance [m].
  void advance(Matrix odometry, double distance);
  void begin_pose() { newest_ = {}; }
  /// The gains of the candidates are no bounds any more, as where a link was taken out.
  void restart(PoseReport& report);

  /// Lines 14 and 15, unless that has been done for this pose.
  void search(CompactGraph& graph, const MatchStatistics& matches, PoseReport& report);
  /// The best that is left: lines 16 and 17.
  std::optional<MatchProposal> next(CompactGraph& graph, const MatchStatistics& matches,
                                    PoseReport& report);
  /// A pose, proposed or not, was matched, or does not match: takes it off the list. Nothing: it
  /// was not on it.
  std::optional<Candidate> take(int pose);
  /// A link with a pose came to this.
  void note_verdict(int pose, LinkVerdict verdict);
  /// All kept poses are tested again for the next pose, as far as the newest is uncertain.
  void look_wide_again();

  /// The newest as seen from a kept pose, with its covariance.
  Displacement displacement(int pose, CompactGraph& graph, PoseReport& report);
  const std::vector<Candidate>& left() const { return newest_.candidates; }
  /// Of a candidate, before any link of the pose.
  const Dimensions& dimensions(const Candidate& candidate) const {
    return newest_.dimensions[candidate.place];
  }
  /// Whether no match was asked for only since what is expected of one is poor: one as good as the
  /// newest odometry would be informative enough.
  bool silenced(CompactGraph& graph, PoseReport& report);
  const DistanceTest& test() const { return *test_; }
  /// Covariance of the newest pose's odometry from the one before, kept or not.
  const Matrix& odometry() const { return odometry_; }

 private:
  /// What was found for the newest pose, and asked of the caller.
  struct Newest {
    bool searched = false;
    std::vector<Candidate> candidates{};   ///< a heap by worth
    std::vector<Dimensions> dimensions{};  ///< of all that were found
    int answered = 0;                      ///< requests for a match
    int in_vain = 0;                       ///< proposed, inconsistent or waiting, in a row
    int proposed = -1;                     ///< the pose that was proposed last; −1: none
  };

  bool gives_up() const;
  bool tested() const { return options_.search == Search::index || options_.search == Search::all; }
  std::vector<int> recorded_pairs(const CompactGraph& graph) const;
  std::vector<int> possible(CompactGraph& graph, PoseReport& report);
  void add(int pose, double gain, const Dimensions& dimensions, const MatchStatistics& matches,
           const CompactGraph& graph);
  bool looks_wide(CompactGraph& graph, PoseReport& report);
  void search_wide(CompactGraph& graph, const MatchStatistics& matches, PoseReport& report);
  double worth(int pose, double gain, const MatchStatistics& matches) const;

  CompactPoseOptions options_;
  double least_gain_ = 0.0;
  std::optional<DistanceTest> test_;
  /// With `Search::recorded`, by pose: the others of which the recording has a measurement; none
  /// without a recording.
  std::optional<std::unordered_map<Id, std::vector<Id>>> recorded_;
  double radius_ = 0.0;  ///< no pose farther away can be a candidate [m]
  double driven_ = 0.0;  ///< since all kept poses were tested last, by odometry [m]
  Matrix sensor_;        ///< Σ̄_y, if it was given
  Matrix odometry_;
  Matrix expected_;          ///< Σ̄_y of the newest pose
  int solved_version_ = -1;  ///< of the graph when candidates were last solved for
  int asked_version_ = -1;   ///< of the graph when a single candidate was evaluated again
  Newest newest_;
};

}  // namespace cairn::compact
