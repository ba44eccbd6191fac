// SPDX-License-Identifier: BSD-3-Clause
#include "iterative/progress.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

namespace cairn::iterative {

void Progress::reset(LinearSolverStats& stats, std::string what, double tolerance) {
  *this = {};
  what_ = std::move(what);
  tolerance_ = tolerance;
  stats.note = what_;
  stats.iterations = 0;
  stats.relative_residual = 0.0;
}

void Progress::add(LinearSolverStats& stats, std::int64_t iterations, double relative_residual,
                   Ending ending) {
  ++solves_;
  limited_ += ending == Ending::limit;
  stagnated_ += ending == Ending::stagnated;
  indefinite_ += ending == Ending::indefinite;
  diverged_ += ending == Ending::diverged;
  stats.iterations += iterations;
  // A residual that is not a number is the worst of all.
  if (!(relative_residual <= stats.relative_residual)) stats.relative_residual = relative_residual;
  write_note(stats);
}

void Progress::describe(LinearSolverStats& stats, std::string what) {
  what_ = std::move(what);
  write_note(stats);
}

void Progress::write_note(LinearSolverStats& stats) const {
  stats.note = what_;
  const auto tell = [&](int count, const std::string& how) {
    if (count > 0) stats.note += fmt::format("; {} of {} solves {}", count, solves_, how);
  };
  tell(limited_, fmt::format("stopped by max_iterations above the tolerance {:.0e}: their steps "
                             "are inexact, and used as they are",
                             tolerance_));
  tell(stagnated_,
       fmt::format("ended above the tolerance {:.0e}, where rounding allows no less", tolerance_));
  tell(indefinite_,
       "met a direction in which H is not positive: the step so far is used, which still descends");
  tell(diverged_, "diverged, and the best iterate is used: a smaller omega converges");
}

}  // namespace cairn::iterative
