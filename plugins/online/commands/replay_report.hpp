// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <boost/json/fwd.hpp>

#include "cairn/evaluation/batch_comparison.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/session.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn::app {

struct ReplayOptions {
  std::string graph;
  std::string output;
  std::string output_format;
  InputOptions input;
  ProblemOptions problem;
  std::string estimator = "incremental_cholesky";
  std::string marginals = "none";
  bool estimate = false;
  bool finish = false;
  int solve_every = 1;
  double budget = 0.0;  ///< [s]
  int keep = 0;         ///< poses of the map at most; 0: all
  std::string select = "nearest";
  std::string sparsifier = "sparsify";
  int checks = 0;
  bool covariance_check = false;
  std::string steps;  ///< CSV file, or empty
  std::string plot;   ///< picture, or empty

  ReplayOptions() { problem.initial = "odometry"; }

  static OptionFields<ReplayOptions> fields();
};

/// One update of the estimator.
struct ReplayStep {
  int variables = 0, factors = 0;  ///< of the graph, after it
  UpdateReport report;
  double seconds = 0.0;   ///< of the update, and of reading the estimate where that is asked for
  double estimate = 0.0;  ///< the part that reading took
  bool solved = true;
  double chi2 = std::nan("");  ///< NaN: not known
};

struct Replay {
  std::vector<ReplayStep> steps;
  std::vector<BatchCheck> checks;
  UpdateSeconds seconds;  ///< sums over the steps
  double estimate = 0.0;  ///< [s] reading estimates
  double total = 0.0;     ///< [s] of all steps
  std::int64_t placed_as_given = 0;
  std::int64_t removed = 0;  ///< poses that have left the map
  std::int64_t dropped = 0;  ///< measurements of these
  double kld = 0.0;          ///< of the factors that replaced them, summed over the blankets [nats]
  std::string removal_note;  ///< why more stay than should
  int failed = 0;            ///< updates whose H was not positive definite
  std::vector<std::string> notes;
  std::vector<std::string> doubts;  ///< of the last estimate; each is among the notes
  bool interrupted = false;

  static ResultFields<Replay> fields();
};

/// "converged", "interrupted" or, of the last update, "not_positive_definite" and, where it was to
/// solve everything and could not, "max_iterations".
std::string_view status(const Replay& replay);

boost::json::object report_json(const ReplayOptions& options, const LoadedGraph& loaded,
                                bool sorted, const Replay& replay, const Estimator& estimator,
                                double chi2);
std::string summary_text(const ReplayOptions& options, const LoadedGraph& loaded,
                         const Replay& replay, double chi2, const Results& results,
                         const Session& session);

/// A row for each step.
std::string steps_csv(const Replay& replay);

/// The time of each step, as a curve; its chi2 where it is known.
void draw_steps(const Replay& replay, const ReplayOptions& options, const LoadedGraph& loaded,
                Session& session);

}  // namespace cairn::app
