// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"

namespace cairn {

/// The smallest eigenvalue of Λ − Λ̆, both linearised at the states of the graphs: Λ of the marginal
/// of `p` on the variables of `q`, Λ̆ of `q`. at[v] is variable v of `q` in `p`; the same of these
/// must be constant in both. The largest eigenvalue of (Λ − Λ̆ + sI)⁻¹ is computed, s being a shift
/// for which that exists: near the end of the spectrum that is asked for, which Lanczos' method
/// alone would only approach.
double least_eigenvalue_of_difference(const Graph& p, const Graph& q, const std::vector<int>& at,
                                      LinearSolver& solver);

}  // namespace cairn
