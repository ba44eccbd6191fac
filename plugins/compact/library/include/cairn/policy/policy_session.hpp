// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/io/stream_format.hpp"
#include "cairn/online/line_session.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/id_runs.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/selection_check.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

struct PolicySettings {
  ReadOptions read;
  std::string output = "last";     ///< estimates at the end of a pose: none, last, changed or all
  std::string marginals = "none";  ///< covariances then: none, last or diagonal
  bool trajectory = false;  ///< whether poses that were not kept can be asked for; takes memory
};

/// A policy decides live which poses are kept and which pairs the front end should match.
///
/// A pose *arrives* with its line and its odometry, is *open* from the first line on that is
/// neither (then the policy has it), and ends with DONE, the line of the next pose or the input.
/// Lines of data only collect; every command first *settles* what came before it, and reports the
/// outcome in its answer; only absolute measurements of the pose, and those of landmarks, wait for
/// its end, when all its links are there. What a command refuses is found before it settles
/// anything.
class CAIRN_API PolicySession final : public LineSession {
 public:
  /// What is referred to must outlive the session.
  PolicySession(PosePolicy& policy, StreamFormat& format, Registry& registry,
                PolicySettings settings);

  /// Before the first line: a map that the poses continue. Its poses are kept ones; where the robot
  /// is on it is unknown until a match with one of them comes; until then the estimates of the new
  /// poses are in a frame of their own, and they have no covariance.
  void load(const Graph& map);
  /// Whether it is known where the robot is on that map; true without one, and before its first
  /// pose.
  bool located() const { return !newest_ || policy_.unlocated().empty(); }
  /// After the end: whether everything was solved to convergence.
  bool converged() const { return converged_; }
  bool succeeded() const override { return located() && converged(); }
  std::vector<std::string> unread_notes() const override;
  /// By `Recovery::likely`; `PolicySettings::trajectory` keeps what that needs.
  Graph trajectory() override;
  void finish() override;
  Estimator& estimator() override { return policy_.estimator(); }
  /// Poses and landmarks that are in the graph.
  std::int64_t variable_count() const override;
  std::int64_t pose_count() const;
  std::int64_t factor_count() const override;
  bool is_variable_type(std::string_view tag) const override {
    return registry_.has("variable", tag);
  }
  std::vector<std::pair<std::string_view, std::int64_t>> counts() const override;
  /// Landmarks that were seen and are not in the graph (`PosePolicy::undetermined`).
  std::int64_t undetermined() const { return std::ssize(policy_.undetermined()); }

 private:
  struct Counts {
    std::int64_t poses = 0;                        ///< that came
    std::int64_t proposed = 0;                     ///< pairs to be matched
    std::int64_t registered = 0;                   ///< pairs that were measured
    std::int64_t linked = 0;                       ///< links that were used
    std::int64_t revoked = 0;                      ///< REMOVE LINK
    std::int64_t priors = 0;                       ///< absolute measurements that are in the graph
    std::int64_t landmarks = 0, observations = 0;  ///< likewise; measurements of landmarks
  };
  struct ArrivingPose {
    Variable pose;
    std::vector<Factor> odometry;
  };
  /// What was measured between the newest pose and another one, and not offered yet.
  struct Measured {
    Id other = 0;
    std::vector<Factor> factors;
  };

  using Command = void (PolicySession::*)(const Words&, Reply&);
  using NamedCommand = std::pair<std::string_view, Command>;
  static std::span<const NamedCommand> commands();
  static Command find_command(std::string_view word);
  void perform(std::string_view line, const Words& words, Reply& reply) override;
  /// A policy may have decided in part.
  bool undoes_failures() const override { return false; }
  void perform_question(const Words& words, Reply& reply);

  // A command each; the words are those of its line.
  void declare(const Words& words, Reply& reply);
  void propose(const Words& words, Reply& reply);
  void note_unmatched(const Words& words, Reply& reply);
  void finish_pose(const Words& words, Reply& reply);
  void take_back(const Words& words, Reply& reply);
  void revoke(const Words& words, Reply& reply);
  void report_covariance(const Words& words, Reply& reply);
  void report_estimate(const Words& words, Reply& reply);
  void report_chi2(const Words& words, Reply& reply);
  void save(const Words& words, Reply& reply);
  void help(const Words& words, Reply& reply);
  void quit(const Words& words, Reply& reply);
  void refuse(const Words& words, Reply& reply);

  // Data
  void take_data(std::string_view text, Reply& reply);
  void take_variable(Variable variable, Reply& reply);
  void take_pose(Variable pose, Reply& reply);
  void take_edge(Factor factor);
  void take_prior(Factor prior);
  void begin_measured(Factor& measured, const std::string& name);
  void take_landmark(const Variable& landmark);
  void take_observation(Factor factor);
  bool is_observation(const Factor& factor) const;
  void hold(std::span<const Id> ids);
  Id other_end(std::span<const Id> ends) const;
  void check_motion(const Factor& factor, Id from) const;
  void check_kept(Id id) const;

  // From the arrival of a pose to its end
  std::optional<Id> current() const;
  bool complete() const;
  void expect_complete() const;
  void begin();
  void offer();
  void offer_priors();
  void offer_landmarks();
  void settle(Reply& reply);
  PoseReport end(Reply& reply);
  void close(Reply& reply);
  void finish_trajectory();
  void note_selection();

  // Answers
  void answer(Reply& reply);
  void note_link(const LinkReport& link);
  void note_prior(const PriorReport& prior);
  void note_landmark(const LandmarkReport& landmark);
  void note_undetermined();
  void note_removed();
  void write_results(bool kept);
  bool in_graph(Id id) const;
  bool on_map(Id id) const;
  void write_estimate(Id id, std::string& text) const;

  PosePolicy& policy_;
  StreamFormat& format_;
  Registry& registry_;
  PolicySettings settings_;
  std::optional<MotionGroup> motions_;  ///< of the poses' type, from the first pose on

  std::optional<ArrivingPose> arriving_;
  std::optional<Id> first_, newest_, before_;  ///< that the policy has
  bool open_ = false, finished_ = false, converged_ = true;
  std::optional<Measured> measured_;
  std::vector<Factor> priors_;                     ///< of the open pose
  std::vector<LandmarkObservation> observations_;  ///< likewise
  /// Those that were declared, or are on the map.
  std::unordered_map<Id, std::shared_ptr<const VariableType>> landmarks_;
  bool asked_place_ = false;          ///< LOCATE, for the open pose
  std::string asked_;                 ///< MATCH …, while nothing came in answer
  IdRuns arrived_;                    ///< all poses that ever came
  std::unordered_set<Id> kept_;       ///< those that are in the graph, but for the open pose
  bool removes_ = false;              ///< poses have left
  std::vector<LinkReport> reported_;  ///< links of the open pose
  std::string answer_;                ///< what the next answer begins with

  std::unordered_map<Id, std::string> reported_states_;  ///< for `changed`
  Counts counts_;
  SelectionCheck selection_;
};

}  // namespace cairn
