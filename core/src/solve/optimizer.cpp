// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/solve/optimizer.hpp"

#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/result_fields.hpp"
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

ResultFields<Iteration> Iteration::fields() {
  using I = Iteration;
  return ResultFields<I>()
      .figure("number", &I::number, "from 1")
      .figure("chi2", &I::chi2, "of the estimate after it")
      .round("{:.8g}")
      .figure("step_norm", &I::step_norm, "Euclidean norm of the step in the tangent space")
      .figure("lambda", &I::lambda,
              "damping, or the inverse of the radius of the trust region; 0 where there is none")
      .attribute("damping")
      .figure("accepted", &I::accepted, "whether the step was taken")
      .figure("seconds", &I::seconds, "s", "of this iteration");
}

ResultFields<Summary> Summary::fields() {
  using S = Summary;
  return ResultFields<S>()
      .figure("optimizer", &S::optimizer, "the optimizer")
      .figure("linear_solver", &S::linear_solver, "what solved the linear systems")
      .figure("status", &S::status,
              "converged, max_iterations, diverged, not_positive_definite or interrupted; whatever "
              "it is, the graph has the best estimate found")
      .figure("chi2.initial", &S::initial_chi2, "of the initial estimate")
      .round("{:.8g}")
      .attribute("initial_chi2")
      .figure("chi2.final", &S::final_chi2, "at the end")
      .round("{:.8g}")
      .attribute("chi2")
      .figure("iterations", &S::iterations, "each iteration")
      .part("seconds", &S::seconds)
      .part("solver", &S::solver)
      .figure("notes", &S::notes, "sentences for the user, such as what was anchored")
      .figure("doubts", &S::doubts, "those of the notes that give reason to doubt the estimate")
      .details();
}

}  // namespace cairn
