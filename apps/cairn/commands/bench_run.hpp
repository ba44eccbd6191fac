// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/latex_table.hpp"
#include "cairn/program/problem_setup.hpp"

namespace cairn::app {

struct BenchOptions {
  std::vector<std::string> graphs;
  std::vector<std::string> names;  ///< what to call the first of them, the second …
  std::vector<std::string> optimizers{kDefaultOptimizer};
  std::vector<std::string> linear_solvers;  ///< empty: all direct ones on offer
  InputOptions input;
  ProblemOptions problem;
  int repeat = 5;
  bool no_memory = false;
  std::string csv;
  std::string latex;
  std::string html;

  static auto fields() {
    using O = BenchOptions;
    return OptionFields<O>()
        .text("graphs", &O::graphs, kGraphHelp)
        .positional()
        .placeholder("GRAPH")
        .or_generated_by({"generator"})
        .required()
        .text("name", &O::names, "what to call the first GRAPH, the second … [its name]")
        .components("optimizer", &O::optimizers, {"optimizer"},
                    "optimizers A,B,… with options as NAME:key=value [levenberg_marquardt]")
        .components("linear_solver", &O::linear_solvers, {"linear_solver"},
                    "linear solvers A,B,… for each of them [all direct ones on offer]")
        .part(&O::problem)
        .part(&O::problem, ProblemOptions::limit_fields())
        .integer("repeat", &O::repeat, 1, 1e6, "rounds; in each, every solver runs once")
        .boolean("no_memory", &O::no_memory, "leave out the extra run for the peak memory")
        .text("csv", &O::csv, "one line per run (- is standard output)")
        .placeholder("FILE")
        .text("latex", &O::latex, kLatexHelp)
        .placeholder("FILE")
        .text("html", &O::html, "all of it as an HTML report with the graphs")
        .placeholder("FILE")
        .part(&O::input);
  }
};

/// One configuration: an optimizer and, where it takes one, a linear solver; as they were written.
struct Configuration {
  std::string optimizer;
  std::string linear_solver;  ///< empty: the optimizer brings its own
  std::string broken;         ///< why it cannot be made although it is on offer, else empty

  ComponentSpec spec() const;
};

/// What is compared.
struct Comparison {
  std::vector<Configuration> configurations;
  std::vector<std::string> left_out;  ///< iterative linear solvers on offer, none being named
};

/// The product of optimizers and linear solvers. An optimizer that brings linear solvers of its
/// own, or names one in its options, stands there once. Where no linear solver is named, all direct
/// ones on offer are meant; notes say what is left out. Throws `Error` for names that are not on
/// offer and for bad options, before anything runs.
Comparison comparison(const BenchOptions& options, Session& session);

/// What one configuration did on one graph; `runs[k]` belongs to round k.
struct ConfigurationResult {
  Configuration configuration;
  std::vector<Summary> runs;
  std::int64_t peak_memory = 0;     ///< [bytes], 0: not measured
  std::string error;                ///< why it could not run, else empty
  std::vector<std::string> doubts;  ///< what speaks against its estimate (`reasons_for_doubt`)
  bool plugin_fault = false;        ///< whether the error is that of a plugin
  Values states;                    ///< of the first run, if a page is to show them
};

struct GraphResult {
  LoadedGraph loaded;
  std::vector<ConfigurationResult> results;
};

struct BenchResult {
  std::vector<GraphResult> graphs;
  std::vector<std::string> left_out;  ///< as in `Comparison`
  bool interrupted = false;
};

/// Runs everything. Within a round each configuration runs once, on a clone of the graph at its
/// initial estimate; each round begins with another one, so that none always follows the same. A
/// configuration that fails has no further runs; the others go on. Stops at an interrupt with the
/// runs that are whole by then.
BenchResult run_bench(const BenchOptions& options, Session& session);

// What the rounds say
// ------------------------------------------------------------------------------
double median(std::vector<double> values);
/// Seconds of optimisation of each round.
std::vector<double> totals(const ConfigurationResult& result);
/// The run whose total time is the median one (the lower of two). There must be one.
const Summary& median_run(const ConfigurationResult& result);
/// Whether a run was ended by the limit of time.
bool ran_out_of_time(const Summary& run, const Stop& stop);
/// Labels that differ between the configurations of a graph, one each: "cholmod" where all have the
/// same optimizer, "dogleg" where all have the same linear solver, else both.
std::vector<std::string> configuration_labels(const std::vector<ConfigurationResult>& results);
/// Median over the rounds of the ratio to the first configuration that ran, in the same round.
double paired_ratio(const ConfigurationResult& result, const GraphResult& graph);
/// How far chi2 is above the lowest of all configurations, relative to that.
double chi2_excess(const ConfigurationResult& result, const GraphResult& graph);
/// Whether chi2 is the lowest to one part in a million (or to rounding, where that is nearly zero).
bool chi2_agrees(const ConfigurationResult& result, const GraphResult& graph);

}  // namespace cairn::app
