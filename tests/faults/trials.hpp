// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "experiment.hpp"

namespace cairn::faults {

/// Makes the inputs of these trials: a small generated graph, what cairn makes of it, and streams
/// of lines. Throws `std::runtime_error`.
void make_inputs(const std::vector<Trial>& trials, Experiment& experiment);

/// The commands of cairn with all their outputs. Run with one thread, so that every run makes the
/// same calls, except where threads are what fails.
std::vector<Trial> cairn_trials();

/// A program that does everything wrong (careless.cpp), to see that it is noticed.
Trial careless_trial();

}  // namespace cairn::faults
