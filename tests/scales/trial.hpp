// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"
#include "change.hpp"
#include "problems.hpp"

namespace cairn::scales {

/// What an optimizer may deviate by: positions as a share of the map's size, angles [rad], focal
/// lengths as a share of themselves, chi2 as a share of itself.
constexpr double kTolerance = 1e-6;

/// An optimizer, and the linear solver that it is to use ("": its own).
struct Method {
  std::string optimizer, linear_solver;
  std::string spec() const;  ///< "dogleg, pcg:preconditioner=subgraph"
  std::unique_ptr<Optimizer> make(Registry& registry) const;
};

/// Every optimizer on offer with every linear solver on offer, each also with every choice of each
/// of its options.
std::vector<Method> all_methods();
/// Every optimizer on offer with every linear solver on offer, by their defaults.
std::vector<Method> few_methods();

/// A problem's solution as it is, without any change.
struct Reference {
  Graph graph;  ///< at the minimum
  double chi2 = 0.0;
  double size = 0.0;  ///< diagonal of the box round all positions
  bool free = false;  ///< only known up to a motion and a scale: compared by distances
};

/// Solved by Levenberg-Marquardt with the default linear solver from the default initial guess, as
/// closely as arithmetic allows.
Reference solve_reference(const Problem& problem, Registry& registry);

/// The problem after a change, with its loss, at the default initial guess.
Graph changed_problem(const Problem& problem, const Change& change, Registry& registry);

enum class Verdict {
  same,    ///< converged, and the estimate is that of the reference
  honest,  ///< has not converged, and says so
  wrong,   ///< converged, and the estimate is another
};

struct Outcome {
  Verdict verdict = Verdict::honest;
  std::string words;  ///< the status, and how far the estimate is off
};

/// How far an estimate is from the reference, in the measure of `kTolerance`; NaN counts as
/// infinitely far.
double deviation(const Reference& reference, const Change& change, const Graph& graph);

/// Judges a run that left its estimate in `graph`.
Outcome judge(const Reference& reference, const Change& change, const Graph& graph,
              const Summary& summary);

/// Optimises a copy of `start` and judges it. A component that fails with an `Error` has said so.
Outcome try_out(const Reference& reference, const Change& change, const Graph& start,
                Optimizer& optimizer);

}  // namespace cairn::scales
