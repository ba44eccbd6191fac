// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/linear_solver.hpp"

#include "cairn/linear/iterative_solver.hpp"

namespace cairn {

LinearSolver::~LinearSolver() = default;
LogDeterminant::~LogDeterminant() = default;
ManyRightHandSides::~ManyRightHandSides() = default;
EliminationOrder::~EliminationOrder() = default;
IterativeSolver::~IterativeSolver() = default;

}  // namespace cairn
