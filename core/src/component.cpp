// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/component.hpp"

#include "cairn/estimator.hpp"
#include "cairn/format.hpp"
#include "cairn/generator.hpp"
#include "cairn/initial_guess.hpp"
#include "cairn/linear_solver.hpp"
#include "cairn/loss.hpp"
#include "cairn/optimizer.hpp"
#include "cairn/stream_format.hpp"

// Destructors of the public interfaces, out of line: each class then has its type information in
// this library alone, and all shared objects agree on it.

namespace cairn {

Component::~Component() = default;
void* Component::ability(std::string_view) { return nullptr; }

LieGroup::~LieGroup() = default;
Placement::~Placement() = default;
VariableType::~VariableType() = default;
FactorType::~FactorType() = default;
Loss::~Loss() = default;
LinearSolver::~LinearSolver() = default;
LogDeterminant::~LogDeterminant() = default;
ManyRightHandSides::~ManyRightHandSides() = default;
EliminationOrder::~EliminationOrder() = default;
Optimizer::~Optimizer() = default;
Estimator::~Estimator() = default;
InitialGuess::~InitialGuess() = default;
Format::~Format() = default;
StreamFormat::~StreamFormat() = default;
Generator::~Generator() = default;

}  // namespace cairn
