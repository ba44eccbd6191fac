// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/solve/optimizer.hpp"

#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace cairn {

Optimizer::~Optimizer() = default;
InitialGuess::~InitialGuess() = default;

std::string_view to_string(Status status) {
  switch (status) {
    case Status::converged:
      return "converged";
    case Status::max_iterations:
      return "max_iterations";
    case Status::diverged:
      return "diverged";
    case Status::not_positive_definite:
      return "not_positive_definite";
    case Status::interrupted:
      return "interrupted";
  }
  return "unknown";  // only a value that is no Status gets here
}

void check(const Stop& stop) {
  const auto refuse = [](const char* name, double value, const char* what) {
    throw Error(ErrorCode::usage, fmt::format("{}={}: expected {}", name, value, what));
  };
  if (stop.max_iterations < 0) refuse("max_iterations", stop.max_iterations, "0 or more");
  // Negated, so that what is not a number is refused too.
  if (!(stop.tolerance >= 0.0 && stop.tolerance <= 1.0))
    refuse("tolerance", stop.tolerance, "a fraction from 0 to 1");
  if (!(stop.max_seconds >= 0.0)) refuse("max_seconds", stop.max_seconds, "0 (no limit) or more");
}

void Summary::doubt(std::string sentence) {
  doubts.push_back(sentence);
  notes.push_back(std::move(sentence));
}

Observer::~Observer() = default;
void Observer::on_start(const Graph&, double) {}
bool Observer::on_iteration(const Iteration&, const Graph&, const Values&) { return true; }
void Observer::on_message(std::string_view) {}

Summary Optimizer::optimize(Graph& graph, const Stop& stop) {
  Observer nobody;
  return optimize(graph, stop, nobody);
}

}  // namespace cairn
