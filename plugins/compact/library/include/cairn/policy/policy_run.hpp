// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/evaluation/normalized_error.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// Poses that follow each other by id in a recording, without a factor between them.
struct OdometryGap {
  Id before = 0, after = 0;
  int measurements = 0;  ///< that lead from one to the other
  int factor = 0;        ///< that stands for odometry: its position in the recording
};
/// A sentence without its full stop; empty where there are none.
CAIRN_API std::string to_string(const std::vector<OdometryGap>& gaps);

/// What to do about such gaps.
enum class Gaps { refuse, bridge };

/// What policies are run on: a recorded pose graph and, if it is known, the truth.
struct PolicyData {
  Graph recording;
  std::optional<Graph> truth_graph;  ///< true states of the same variables, of the same types
  std::optional<Trajectory> truth;   ///< true poses, perhaps of other types
  std::vector<Arrival> poses;
  std::vector<OdometryGap> gaps = {};            ///< that were bridged
  std::int64_t loops = 0;                        ///< factors between poses besides odometry
  std::int64_t priors = 0;                       ///< factors on one pose
  std::int64_t landmarks = 0, observations = 0;  ///< landmarks; factors on a pose and a landmark
};

/// Throws `Error` (input) as `pose_chain` does. A `truth` that lacks a pose of the recording, or
/// has it with another type, gives errors of the trajectory only. With `begin`, the trajectory
/// begins at the pose with this id: those before it are of earlier sessions. Where odometry is
/// missing and other measurements lead from a pose to the next, `Gaps::bridge` adds a factor along
/// the most certain way of these, ten times as uncertain, since they are used again.
CAIRN_API PolicyData policy_data(Graph recording, std::optional<Graph> truth = {},
                                 std::optional<Id> begin = {}, Gaps gaps = Gaps::refuse);

/// A policy and a registration by name, with options.
struct PolicyJob {
  ComponentSpec policy;
  std::string registration = "recorded";
  /// A registration that is not registered by a name, instead; it must outlive the runs.
  Registration* own = nullptr;
};

/// How one policy fared.
struct PolicyResult {
  std::string policy;  ///< with its options
  std::vector<PoseReport> poses;
  Graph compact;     ///< the estimate of what was kept
  Graph trajectory;  ///< the whole trajectory: what was left out is put back
  /// By the name of the recovery ("v0", …), or "whole" (`take_whole_map`); empty without the truth.
  std::map<std::string, TrajectoryError> errors;
  std::optional<NormalizedError> normalized;
  double chi2 = 0.0;
  /// Of the recording: loop closures, absolute measurements, landmarks and measurements of these.
  std::int64_t loops = 0, priors = 0, landmarks = 0, observations = 0;
  std::int64_t proposed = 0, registered = 0, kept_loops = 0;
  std::int64_t false_registered = 0, false_kept = 0;  ///< as far as the registration knows
  std::map<std::string, std::int64_t> verdicts;
  std::int64_t kept_priors = 0;  ///< absolute measurements that are in the graph
  /// Landmarks of the recording, and factors on these, that are in the graph.
  std::int64_t kept_landmarks = 0, kept_observations = 0;
  std::int64_t nonlinear_observations = 0;  ///< left out for that (`LinkVerdict::nonlinear`)
  /// Of the others, those that what was measured of them does not determine.
  std::int64_t undetermined_landmarks = 0;
  PolicySeconds seconds;
  double registration_seconds = 0.0;
  std::int64_t information_nonzeros = 0, factor_nonzeros = 0;
  bool interrupted = false;
  bool converged = true;  ///< the estimate at the end
  int kept_poses = 0;     ///< in `compact`, those of the map among them
  int map_poses = 0;      ///< of these, those of the map that was continued
  /// False: no match was found with that map, so that the two are not connected.
  bool located = true;

  CAIRN_API static ResultFields<PolicyResult> fields();
};

/// What all runs over the same data share. Everything referred to must outlive the runs.
struct PolicySetting {
  const PolicyData& data;
  Registry& registry;
  std::shared_ptr<const Loss> loss = nullptr;  ///< shared: graphs and their clones use one loss
  FactorSelector loss_on = {};
  const std::atomic<bool>* interrupt = nullptr;  ///< a run ends early once it is true
  /// Called after each pose, with the run's title, how many poses it has, and its counts so far.
  std::function<void(std::string_view title, std::size_t poses, const PolicyResult& counts)>
      progress = {};

  bool interrupted() const { return interrupt && interrupt->load(); }
};

/// A policy over the first poses of a recording, counted and timed.
class CAIRN_API PolicyRun {
 public:
  /// `setting` must outlive the run. Throws `Error` for a name or an option that there is not,
  /// where the registration needs a truth that is not known, (usage) if the recording has landmarks
  /// and the policy takes none, and (input) for a landmark that is fixed.
  PolicyRun(const PolicyJob& job, const PolicySetting& setting);

  /// Before `run`: the trajectory continues this map (`PosePolicy::load`).
  void load(const Graph& map);
  /// Runs over `count` poses; once. `title` goes to the progress; `after` is called with the number
  /// of each pose after the policy has ended it.
  void run(std::size_t count, std::string_view title,
           const std::function<void(std::size_t)>& after = {});

  PosePolicy& policy() { return *policy_; }
  /// Counts and times so far, without graphs and errors.
  const PolicyResult& counts() const { return result_; }
  /// Everything, with the left-out poses put back by `recovery`; once.
  PolicyResult finish(Recovery recovery);

 private:
  const PolicySetting& setting_;
  std::unique_ptr<PosePolicy> policy_;
  std::string registration_name_;
  std::unique_ptr<Registration> made_;  ///< null: it is the caller's own
  Registration* registration_;
  PolicyResult result_;
};

/// Replaces the errors and the NEES of a result, whose graphs have been replaced: the trajectory's
/// errors are under this name. Nothing without the truth.
CAIRN_API void evaluate_again(PolicyResult& result, const PolicyData& data,
                              const std::string& name);

}  // namespace cairn
