// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cairn/evaluation/normalized_error.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "graph_files.hpp"
#include "interrupt.hpp"
#include "problem_setup.hpp"

namespace cairn::app {

/// The recording, as it is fed to policies.
struct Recording {
  LoadedGraph loaded;
  std::optional<Graph> truth_graph;  ///< of the same types, if it is known
  std::optional<Trajectory> truth;
  std::vector<RecordedPose> poses;
  std::int64_t loops = 0;  ///< links besides odometry

  const Graph& graph() const { return loaded.graph; }
};

/// A policy's name with options, and its registration.
struct CompactJob {
  ComponentSpec policy;
  std::string registration = "recorded";
};

/// How one policy fared.
struct CompactResult {
  std::string policy;  ///< with its options
  std::vector<PoseReport> poses;
  Graph compact;                                  ///< the estimate of what was kept
  Graph way;                                      ///< with what was left out put back
  std::map<std::string, TrajectoryError> errors;  ///< by way of recovery; empty without the truth
  std::optional<NormalizedError> normalized;
  double chi2 = 0.0;
  std::int64_t proposed = 0, registered = 0, kept_loops = 0;
  std::int64_t false_registered = 0, false_kept = 0;  ///< as far as the registration knows
  std::map<std::string, std::int64_t> verdicts;
  PolicySeconds seconds;
  double registration_seconds = 0.0;
  std::int64_t information_nonzeros = 0, factor_nonzeros = 0;
  bool interrupted = false;
};

/// What all runs of one command share.
struct CompactSetting {
  const Recording& recording;
  const ProblemSetup& setup;
  const InterruptGuard& guard;
  Session& session;
};

/// A policy over the first poses of a recording.
class CompactRun {
 public:
  CompactRun(const CompactJob& job, const CompactSetting& setting);
  /// Runs over so many poses; once. `title` is shown with the progress, and `after` is called with
  /// the number of each pose.
  void run(std::size_t count, const std::string& title,
           const std::function<void(std::size_t)>& after = {});

  PosePolicy& policy() { return *policy_; }
  /// Counts and times; the graphs and errors are not in it yet.
  const CompactResult& counts() const { return result_; }
  /// All of it, with the left-out poses put back in this way.
  CompactResult finish(Recovery recovery);

 private:
  const CompactSetting& setting_;
  std::unique_ptr<PosePolicy> policy_;
  std::unique_ptr<Registration> registration_;
  CompactResult result_;
};

/// "compact_pose:range=5,angle=0.5"
std::string spec_text(const ComponentSpec& spec);

}  // namespace cairn::app
