// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn::initial {

std::unique_ptr<InitialGuess> make_as_given();

std::unique_ptr<InitialGuess> make_odometry();

OptionTable spanning_tree_options();
std::unique_ptr<InitialGuess> make_spanning_tree(const Options& options);

OptionTable chordal_options();
std::unique_ptr<InitialGuess> make_chordal(const Options& options,
                                           std::unique_ptr<LinearSolver> solver);

OptionTable incremental_options();
std::unique_ptr<InitialGuess> make_incremental(const Options& options,
                                               std::unique_ptr<Optimizer> optimizer);

}  // namespace cairn::initial
