// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/evaluation/watched_guess.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/session.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/loss.hpp"

namespace cairn::app {

inline constexpr const char* kDefaultOptimizer = "levenberg_marquardt";
inline constexpr const char* kDefaultLinearSolver = "block_cholesky";
/// Of an optimizer: the option that names a component of kind linear_solver.
inline constexpr const char* kLinearSolverOption = "linear_solver";

/// Options of commands that optimise about the problem, besides those of the solvers.
struct ProblemOptions {
  std::string initial = "auto";  ///< empty: the states as they are, with no option for it
  std::string loss;              ///< empty: none
  std::string loss_on = "all";
  Stop stop;

  /// Of commands that optimise a graph as it is read.
  static OptionFields<ProblemOptions> fields();
  /// The part of them that is about the loss.
  static OptionFields<ProblemOptions> loss_fields();
  /// --max-seconds, the limit of each run.
  static OptionFields<ProblemOptions> limit_fields();
};
/// For --as-given: no initial guess, unless one is named.
void keep_states(ProblemOptions& options);

/// The initial guess and the loss that the options name; made before a graph is read, so that a
/// wrong name is reported at once.
class ProblemSetup {
 public:
  ProblemSetup(const ProblemOptions& options, Registry& registry);
  /// Gives the graph its loss and its initial estimate. Returns notes for the user. `go_on`: shows
  /// the progress of a guess that takes long, and may end it.
  std::vector<std::string> apply(Graph& graph, WatchedGuess::GoOn go_on = {}) const;
  /// After an optimisation from there: `look_again` of the initial guess.
  void look_again(Graph& graph, Optimizer& optimizer, std::string_view name, const Stop& stop,
                  Observer& observer, WatchedGuess::GoOn go_on, Summary& summary) const;

  const std::shared_ptr<const Loss>& loss() const { return loss_; }
  const FactorSelector& loss_selector() const { return selector_; }

 private:
  std::string initial_name_;
  std::unique_ptr<InitialGuess> initial_;  // null: the states as they are
  std::shared_ptr<const Loss> loss_;       // shared: graphs and their clones use one loss
  FactorSelector selector_;
};

/// As of the library, with the program's name of the limit.
void note_the_end(Summary& summary, const Stop& stop, const Graph& graph);

/// 0 where it converged, or had no tolerance to reach; else that of a numerical failure, or of an
/// interruption.
int exit_code(const Summary& summary, const Stop& stop);

/// Whether an optimizer lets its linear solver be chosen: an option `linear_solver` of type
/// component.
bool takes_linear_solver(Registry& registry, const ComponentSpec& optimizer);

/// The optimizer with the linear solver that the command line names (empty: none), or cairn's own,
/// put in. Throws `Error` (usage) where it does not take one.
ComponentSpec optimizer_spec(const std::string& optimizer, const std::string& linear_solver,
                             Registry& registry);

/// Why a linear solver that was asked for cannot be given to that optimizer, and what to use
/// instead.
Error linear_solver_refused(Registry& registry, const ComponentSpec& optimizer);

}  // namespace cairn::app
