// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/linear/linear_solver.hpp"

namespace cairn {

LinearSolver::~LinearSolver() = default;
LogDeterminant::~LogDeterminant() = default;
ManyRightHandSides::~ManyRightHandSides() = default;
EliminationOrder::~EliminationOrder() = default;

}  // namespace cairn
