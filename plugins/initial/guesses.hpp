// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn::initial {

std::unique_ptr<InitialGuess> make_as_given();

std::unique_ptr<InitialGuess> make_odometry();

/// Which way from a variable to the root of a tree is the shortest.
enum class TreeWeight {
  depth,        ///< with the fewest factors
  information,  ///< with the least variance
};
constexpr auto enum_names(TreeWeight) {
  return std::to_array<EnumName<TreeWeight>>(
      {{TreeWeight::depth, "depth"}, {TreeWeight::information, "information"}});
}

struct SpanningTreeOptions {
  TreeWeight weight = TreeWeight::depth;

  static auto fields() {
    return OptionFields<SpanningTreeOptions>().choice(
        "weight", &SpanningTreeOptions::weight,
        "shortest path to the root: fewest factors, or least variance");
  }
};

std::unique_ptr<InitialGuess> make_spanning_tree(const SpanningTreeOptions& options);

/// Weight of a relative orientation.
enum class ChordalWeight { information, unit };
constexpr auto enum_names(ChordalWeight) {
  return std::to_array<EnumName<ChordalWeight>>(
      {{ChordalWeight::information, "information"}, {ChordalWeight::unit, "unit"}});
}

struct ChordalOptions {
  std::string linear_solver = "block_cholesky";
  ChordalWeight weight = ChordalWeight::information;

  static auto fields() {
    using O = ChordalOptions;
    return OptionFields<O>()
        .component<LinearSolver>("linear_solver", &O::linear_solver,
                                 "solves for orientations and positions")
        .choice("weight", &O::weight, "weight of a relative orientation: its information, or one");
  }
};

std::unique_ptr<InitialGuess> make_chordal(const ChordalOptions& options,
                                           std::unique_ptr<LinearSolver> solver);

struct IncrementalOptions {
  int step = 100;       ///< poses between two optimisations; 0: 2 % of them, at least 100
  int iterations = 10;  ///< of each, at most
  std::string optimizer = "levenberg_marquardt";

  static auto fields() {
    using O = IncrementalOptions;
    return OptionFields<O>()
        .integer("step", &O::step, 0, 1e9,
                 "poses between two optimisations; 0: 2 % of all, at least 100")
        .integer("iterations", &O::iterations, 1, 1e6, "maximum number of iterations of each")
        .component<Optimizer>("optimizer", &O::optimizer,
                              "the optimizer of the part of the graph added so far");
  }
};

/// `least_step`: of the poses between two optimisations where these are a part of all (step 0).
std::unique_ptr<InitialGuess> make_incremental(const IncrementalOptions& options,
                                               std::unique_ptr<Optimizer> optimizer,
                                               int least_step = 100);

struct AutomaticOptions {
  std::string linear_solver = "block_cholesky";
  std::string optimizer = "levenberg_marquardt";
  int iterations = 20;

  static auto fields() {
    using O = AutomaticOptions;
    return OptionFields<O>()
        .component<LinearSolver>("linear_solver", &O::linear_solver, "of the chordal relaxation")
        .component<Optimizer>("optimizer", &O::optimizer,
                              "tries starts, and is that of incremental")
        .integer("iterations", &O::iterations, 1, 1e6, "maximum number of iterations of the trial");
  }
};

/// What `auto` chooses from besides the states as given; null: not available.
struct Candidates {
  std::unique_ptr<InitialGuess> chordal;
  std::unique_ptr<Optimizer> optimizer;  ///< for trials
  /// Makes one of another kind, which ends in other minima; null: there is none. Only a search
  /// needs it, and few graphs are searched.
  std::function<std::unique_ptr<Optimizer>()> make_other;
  std::unique_ptr<InitialGuess> incremental;
  std::unique_ptr<InitialGuess> small_steps;  ///< incremental, with 50 optimisations
};

std::unique_ptr<InitialGuess> make_automatic(const AutomaticOptions& options,
                                             Candidates candidates);

}  // namespace cairn::initial
