// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cairn/evaluation/watched_guess.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

/// The components of an optimisation, each with the name by which errors and notes call it.
struct Optimization {
  Optimizer& optimizer;
  std::string_view optimizer_name;
  InitialGuess* guess = nullptr;  ///< null: from the graph's own states
  std::string_view guess_name;
};

/// An optimizer with the linear solver that suits a graph, where it takes one and the spec names
/// none: `schur` (if there is that plugin) where at least half of the variables are points of which
/// no factor joins two, as in bundle adjustment; they are eliminated first then. Otherwise the spec
/// as it is.
CAIRN_API ComponentSpec with_suited_linear_solver(ComponentSpec optimizer, const Graph& graph,
                                                  Registry& registry);

/// Lets a guess replace the graph's states. `go_on` is asked, if the guess can be watched, whether
/// it may go on. Returns the guess's notes. What it throws names it (`call_plugin`).
CAIRN_API std::vector<std::string> compute_guess(Graph& graph, InitialGuess& guess,
                                                 std::string_view name,
                                                 WatchedGuess::GoOn go_on = {});

/// After an optimisation that has converged from what `of.guess` computed: lets a guess that can
/// (`SecondLook`) compare that minimum with others, and goes on from a lower one, so that the
/// summary is that of both: iterations follow one another, and the notes are completed. Does
/// nothing where there is no such guess, or where there was no tolerance to reach.
/// `stop.max_seconds` is the limit of both. `go_on`: as above.
CAIRN_API void look_again(Graph& graph, const Optimization& of, const Stop& stop,
                          Observer& observer, WatchedGuess::GoOn go_on, Summary& summary);

/// The initial guess, then the optimizer, then `look_again`. The summary's notes are those of the
/// guess, each after "initial guess NAME: ", those of the optimizer, and those on the end
/// (`note_the_end`). `go_on`: as above; none: what `stop.interrupt` says. What a component
/// throws names it.
CAIRN_API Summary optimize(Graph& graph, const Optimization& of, const Stop& stop,
                           Observer& observer, WatchedGuess::GoOn go_on = {});

/// Whether a run leaves an estimate that may be used as the minimum: it has converged, or had no
/// tolerance to reach and made its iterations. Otherwise the graph has the best states found, and
/// whatever is computed from them has to say that they are none.
CAIRN_API bool is_estimate(const Summary& summary, const Stop& stop);

/// Adds to a summary what is to be said at the end of a run: that it stopped before it converged,
/// by the limit `max_iterations` (which the program calls by the name of its option), and what
/// speaks against the estimate (`reasons_for_doubt`), both as doubts; and what is free. Adds
/// nothing to one that was interrupted.
CAIRN_API void note_the_end(Summary& summary, const Stop& stop, const Graph& graph,
                            std::string_view max_iterations = "max_iterations");

}  // namespace cairn
