// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/seconds.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// When to stop.
struct Stop {
  int max_iterations = 200;
  /// Stop when a step could lower chi2 by less than this fraction. 0: run exactly `max_iterations`.
  double tolerance = 1e-10;
  double max_seconds = 0.0;  ///< 0: no limit
  const std::atomic<bool>* interrupt =
      nullptr;  ///< stop with the best estimate when it becomes true
};

/// Throws `Error` (usage) for limits that are negative or not a number, and for a tolerance that is
/// no fraction; every optimizer of cairn's own begins with it.
CAIRN_API void check(const Stop& stop);

enum class Status { converged, max_iterations, diverged, not_positive_definite, interrupted };

/// "converged", "max_iterations", … as in the JSON of the command line.
CAIRN_API std::string_view to_string(Status status);

/// One iteration. chi2 is that of the estimate after it.
struct Iteration {
  int number = 0;  ///< from 1
  double chi2 = 0.0;
  double step_norm = 0.0;  ///< Euclidean norm of the step in the tangent space
  double lambda = 0.0;     ///< damping or 1/trust-region radius; 0 where there is none
  bool accepted = true;
  double seconds = 0.0;  ///< of this iteration

  CAIRN_API static ResultFields<Iteration> fields();
};

/// Is notified of the progress of an optimisation: the base of progress bars, logs, recordings and
/// early stops.
class CAIRN_API Observer {
 public:
  virtual ~Observer();
  /// Before the first iteration.
  virtual void on_start(const Graph& graph, double chi2);
  /// After each iteration, with the best states so far. Return false to stop.
  virtual bool on_iteration(const Iteration& iteration, const Graph& graph, const Values& values);
  /// A sentence for the user, such as which variable was anchored.
  virtual void on_message(std::string_view message);
};

/// How an optimisation ended.
struct Summary {
  std::string optimizer;
  std::string linear_solver;
  Status status = Status::max_iterations;
  double initial_chi2 = 0.0;
  double final_chi2 = 0.0;
  std::vector<Iteration> iterations;
  Seconds seconds;
  LinearSolverStats solver;
  /// Notes for the user, one sentence each: the gauge, why a factorisation failed and at which
  /// variable, where it stopped.
  std::vector<std::string> notes;
  /// Those of the notes that give reason to doubt the estimate: it has not converged, or may be
  /// another minimum than the right one. What only informs, such as what was anchored or is free,
  /// is not among them.
  std::vector<std::string> doubts;

  /// Adds a note that is a reason for doubt.
  CAIRN_API void doubt(std::string sentence);

  CAIRN_API static ResultFields<Summary> fields();
};

/// Minimises Σ ρ(‖r‖²) over a graph's variables, starting from its states and leaving the best
/// states found in it. The graph's structure is not changed; gauge freedoms are removed by anchors
/// (`resolve_gauge`). A diverging, interrupted or failed run leaves the best estimate too, and is
/// reported in `Summary::status`. Throws `Error` only for bad calls.
class CAIRN_API Optimizer : public Component {
 public:
  static constexpr std::string_view kKind = "optimizer";
  ~Optimizer() override;

  virtual Summary optimize(Graph& graph, const Stop& stop, Observer& observer) = 0;
  /// Without an observer.
  Summary optimize(Graph& graph, const Stop& stop = {});
};

}  // namespace cairn
