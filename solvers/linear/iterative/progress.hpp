// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "cairn/linear/linear_solver.hpp"

namespace cairn::iterative {

/// How one solve ended.
enum class Ending {
  reached,     ///< the tolerance
  limit,       ///< the limit of iterations, above the tolerance
  stagnated,   ///< above the tolerance, where rounding lets it fall no further
  indefinite,  ///< a direction was met in which H is not positive
  diverged,    ///< the residual grew
};

/// Counts what an iterative solver did since `analyze`, and puts it into `LinearSolverStats`.
class Progress {
 public:
  /// `what`: the note to begin with, such as the preconditioner.
  void reset(LinearSolverStats& stats, std::string what, double tolerance);
  /// Another note to begin with, from now on.
  void describe(LinearSolverStats& stats, std::string what);
  /// After each solve: relative_residual is the true ‖Hx − g‖/‖g‖ of what was returned.
  void add(LinearSolverStats& stats, std::int64_t iterations, double relative_residual,
           Ending ending);

 private:
  void write_note(LinearSolverStats& stats) const;

  std::string what_;
  double tolerance_ = 0.0;
  int solves_ = 0, limited_ = 0, stagnated_ = 0, indefinite_ = 0, diverged_ = 0;
};

}  // namespace cairn::iterative
