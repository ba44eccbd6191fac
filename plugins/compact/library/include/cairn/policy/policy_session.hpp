// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/io/stream_format.hpp"
#include "cairn/online/command_session.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/selection_check.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

class PolicyAnswers;
class PoseIntake;

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
class CAIRN_API PolicySession final : public CommandSession {
 public:
  /// What is referred to must outlive the session.
  PolicySession(PosePolicy& policy, StreamFormat& format, Registry& registry,
                PolicySettings settings);
  ~PolicySession() override;

  /// Before the first line: a map that the poses continue. Its poses are kept ones; where the robot
  /// is on it is unknown until a match with one of them comes; until then the estimates of the new
  /// poses are in a frame of their own, and they have no covariance.
  void load(const Graph& map);
  /// Whether it is known where the robot is on that map; true without one, and before its first
  /// pose.
  bool located() const;
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
  std::vector<std::pair<std::string_view, std::int64_t>> counts() const override;
  /// Landmarks that were seen and are not in the graph (`PosePolicy::undetermined`).
  std::int64_t undetermined() const { return std::ssize(policy_.undetermined()); }

 private:
  void perform(std::string_view line, const Words& words, Reply& reply) override;
  /// A policy may have decided in part.
  bool undoes_failures() const override { return false; }

  // A command each; the words are those of its line.
  void declare(const Words& words, Reply& reply);
  void propose(const Words& words, Reply& reply);
  void note_unmatched(const Words& words, Reply& reply);
  void finish_pose(const Words& words, Reply& reply);
  void take_back(const Words& words, Reply& reply);
  void revoke(const Words& words, Reply& reply);
  void report_covariance(const Words& words, Reply& reply);
  void report_estimate(const Words& words, Reply& reply);
  void refuse(const Words& words, Reply& reply);

  // Data
  void take_data(std::string_view text, Reply& reply) override;
  void take_variable(Variable variable, Reply& reply);
  void take_factor(Factor factor);
  void take_edge(Factor factor);
  void begin_measured(Factor& measured);
  void hold(std::span<const Id> ids);

  // From the arrival of a pose to its end
  void begin();
  void offer();
  void offer_priors();
  void offer_landmarks();
  void settle(Reply& reply) override;
  PoseReport end(Reply& reply);
  void close(Reply& reply);

  // Answers
  void answer(Reply& reply, std::string text) override;
  void note_decisions(const PoseReport& report);
  void note_removed();
  void note_end();
  void write_results(bool kept);
  bool in_graph(Id id) const;
  bool on_map(Id id) const;
  std::string estimate_of(Id id) const;

  PosePolicy& policy_;
  PolicySettings settings_;
  std::unique_ptr<PoseIntake> intake_;
  std::unique_ptr<PolicyAnswers> answers_;
  SelectionCheck selection_;

  bool asked_place_ = false;          ///< LOCATE, for the open pose
  std::string asked_;                 ///< MATCH …, while nothing came in answer
  std::vector<LinkReport> reported_;  ///< links of the open pose
  bool finished_ = false, converged_ = true;
};

}  // namespace cairn
