// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/program/figure_files.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/session.hpp"
#include "cairn/sparsification/redirection.hpp"
#include "cairn/sparsification/sparsify_graph.hpp"

namespace cairn::app {

struct SparsifyCommandOptions {
  std::string graph;
  std::string output, output_format;
  std::string sparsifier = "sparsify";
  std::string select;
  std::optional<std::int64_t> keep_every;
  std::string edges;
  std::string nodes = "poses";
  std::string topology, recovery, population, scheme;
  std::string optimizer = kDefaultOptimizer, linear_solver = kDefaultLinearSolver;
  std::string estimator = "incremental_cholesky";
  std::optional<std::int64_t> online;  ///< take nodes out every so many poses
  bool as_given = false, no_kld = false;
  FigureFiles figures;
  InputOptions input;
  ProblemOptions problem;
  // Of studies:
  bool is_study = false;  ///< new factors measure their blanket's own minimum, as in the thesis
  std::string redirect = "late", redirect_to;
  bool newer = false;
  double inflation = RedirectionRule{}.inflation;
  std::string information_frame = "second";
  std::string compared_at = "common";
  std::string record;

  static OptionFields<SparsifyCommandOptions> fields();
};

/// "; the estimate has moved by 0.1 m (RMS), 0.05 m after alignment"; empty where that is not
/// known.
std::string moved_text(const SparsifyResult& result);

/// Returns the exit code.
int run_sparsify(SparsifyCommandOptions options, Session& session);

}  // namespace cairn::app
