// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/solve/optimizer.hpp"

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

Observer::~Observer() = default;
void Observer::on_start(const Graph&, double) {}
bool Observer::on_iteration(const Iteration&, const Graph&, const Values&) { return true; }
void Observer::on_message(std::string_view) {}

Summary Optimizer::optimize(Graph& graph, const Stop& stop) {
  Observer nobody;
  return optimize(graph, stop, nobody);
}

}  // namespace cairn
