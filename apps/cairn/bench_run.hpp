// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "graph_files.hpp"
#include "problem_setup.hpp"

namespace cairn::app {

struct BenchOptions {
  std::vector<std::string> graphs;
  std::vector<std::string> optimizers{kDefaultOptimizer};
  std::vector<std::string> linear_solvers;  ///< empty: all on offer
  InputOptions input;
  ProblemOptions problem;
  int repeat = 5;
  bool no_memory = false;
  std::string csv;
  std::string html;
};

/// One configuration: an optimizer and, where it takes one, a linear solver; as they were written.
struct Configuration {
  std::string optimizer;
  std::string linear_solver;  ///< empty: the optimizer brings its own

  ComponentSpec spec() const;
};

/// The product of optimizers and linear solvers. An optimizer that brings linear solvers of its
/// own, or names one in its options, stands there once. Throws `Error` for names that are not on
/// offer, so that nothing is found out half way; only where all are meant, one that cannot be
/// loaded is left out, with a note.
std::vector<Configuration> configurations(const BenchOptions& options, Session& session);

/// What one configuration did on one graph; `runs[k]` belongs to round k.
struct ConfigurationResult {
  Configuration configuration;
  std::vector<Summary> runs;
  std::int64_t peak_memory = 0;  ///< [bytes], 0: not measured
  std::string error;             ///< why it could not run, else empty
  Values states;                 ///< of the first run, if a page is to show them
};

struct GraphResult {
  LoadedGraph loaded;
  std::vector<ConfigurationResult> results;
};

/// Runs everything. Within a round each configuration runs once, on a clone of the graph at its
/// initial estimate; each round begins with another one, so that none always follows the same.
/// Stops at an interrupt with the runs that are whole by then, which `interrupted` shows.
std::vector<GraphResult> run_bench(const BenchOptions& options, Session& session,
                                   bool& interrupted);

// What the rounds say
// ------------------------------------------------------------------------------
double median(std::vector<double> values);
/// Seconds of optimisation of each round.
std::vector<double> totals(const ConfigurationResult& result);
/// The run whose total time is the median one (the lower of two). There must be one.
const Summary& median_run(const ConfigurationResult& result);
/// Median over the rounds of the ratio to the first configuration that ran, in the same round.
double paired_ratio(const ConfigurationResult& result, const GraphResult& graph);
/// How far chi2 is above the lowest of all configurations, relative to that.
double chi2_excess(const ConfigurationResult& result, const GraphResult& graph);
/// Whether chi2 is the lowest to one part in a million (or to rounding, where that is nearly zero).
bool chi2_agrees(const ConfigurationResult& result, const GraphResult& graph);

}  // namespace cairn::app
