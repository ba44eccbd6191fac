// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "experiment.hpp"

namespace cairn::faults {

/// How large the inputs of trials are.
struct InputSizes {
  int graph = 40, stream = 8;  ///< poses
};

/// So large that there is time to kill a process while it works.
inline constexpr InputSizes kForKills{400, 150};

/// Makes the inputs of these trials: a small generated graph, what cairn makes of it, and streams
/// of lines. Throws `std::runtime_error`.
void make_inputs(const std::vector<Trial>& trials, const InputSizes& sizes, Experiment& experiment);

/// The commands of cairn with all their outputs. Run with one thread, so that every run makes the
/// same calls, except where threads are what fails.
std::vector<Trial> cairn_trials();

/// The same, `cairn online` with all ways to synchronise its journal, and `cairn explore` with a
/// recording, for processes that are killed.
std::vector<Trial> kill_trials();

/// A program that does everything wrong (careless.cpp), to see that it is noticed.
Trial careless_trial();
/// The same with a journal. Makes its input.
Trial careless_online_trial(Experiment& experiment);

}  // namespace cairn::faults
