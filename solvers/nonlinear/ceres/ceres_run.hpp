// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string_view>

#include <ceres/iteration_callback.h>

#include "cairn/graph/gauge.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

/// Ceres logs failed steps through glog to standard error; libraries do not print. Quiet while an
/// object of this class exists.
class QuietGlog {
 public:
  QuietGlog();
  ~QuietGlog();
  QuietGlog(const QuietGlog&) = delete;
  QuietGlog& operator=(const QuietGlog&) = delete;

 private:
  int level_;
};

/// A step of this fraction of the states, or of this change of chi2, may fail because of rounding.
inline constexpr double kCeresRounding = 1e-6;

/// Begins the summary of a run: the names, and the note on the gauge, which the observer gets too.
Summary begin_summary(std::string_view optimizer, std::string_view linear_solver,
                      const Graph& graph, const Gauge& gauge, Observer& observer);

/// Adds what the measurements leave free at the graph's states to the notes.
void note_free_directions(const Graph& graph, const Gauge& gauge, Summary& summary);

/// Whether there is nothing to do, because every variable is constant, no iteration is allowed, or
/// chi2 is not finite: then summary and observer have been completed, but for the total time. The
/// initial chi2 is in the summary either way.
bool ends_at_once(const Graph& graph, const Gauge& gauge, const Stop& stop, Observer& observer,
                  Summary& summary);

/// Begins where all residuals have a meaning, with a note, if that lowers chi2 (`enter_domains`).
void begin_inside(const Graph& graph, const Gauge& gauge, Values& values, Summary& summary);

/// Runs `once`, and again from beside stationary factors where a run has converged at some
/// (`Departures`), as one optimisation; the best estimate stays.
Summary with_departures(Graph& graph, const Stop& stop, Observer& observer,
                        const std::function<Summary(Graph&, const Stop&, Observer&)>& once);

}  // namespace cairn
