// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/sparsification/sparsification.hpp"
#include "graph_files.hpp"
#include "interrupt.hpp"
#include "problem_setup.hpp"

namespace cairn::app {

/// What takes nodes out, and which.
struct SparsifyJob {
  ComponentSpec sparsifier;  ///< with its options
  ComponentSpec selection;
  ComponentSpec optimizer;
  std::string linear_solver = kDefaultLinearSolver;
  std::string estimator = "incremental_cholesky";  ///< online
  int online = 0;                                  ///< 0: off; else after so many poses
  /// Online: one of so many nodes is known to stay, and factors to older nodes that are to leave
  /// are redirected at once, to the nearest by id (T 4.6.4); 0: only once these have left, and to
  /// the nearest in space.
  int redirect_early = 0;
  bool as_given = false;  ///< not optimised before
  bool measure = true;    ///< the KLD and RMSE of the whole
};

struct SparsifyResult {
  Graph sparse;  ///< at its minimum
  Sparsification change;
  std::int64_t variables_before = 0, factors_before = 0;
  std::optional<SparsificationError> error;  ///< from the original; online, with the same factors
                                             ///< redirected
  double rmse_full = 0.0;  ///< online: from the minimum of all factors as they came [m]
  double chi2_before = 0.0, chi2_after = 0.0;
  double select_seconds = 0.0;
  // Online
  std::int64_t redirected = 0, dropped = 0;  ///< factors that came for nodes that had left
  std::vector<double> steps;                 ///< seconds of each pose, sparsification included
  bool interrupted = false;
  std::vector<std::string> notes;
};

struct SparsifySetting {
  const ProblemSetup& setup;
  const Stop& stop;
  const InterruptGuard& guard;
  Session& session;
  SparsificationObserver observer;  ///< may be empty
};

/// Optimises a whole graph, then takes nodes out of it.
SparsifyResult sparsify_whole(const Graph& graph, const SparsifyJob& job,
                              const SparsifySetting& setting);

/// Feeds a graph to an estimator pose by pose, and takes nodes out every so many (T 4.6.4).
SparsifyResult sparsify_online(const Graph& recording, const SparsifyJob& job,
                               const SparsifySetting& setting);

}  // namespace cairn::app
