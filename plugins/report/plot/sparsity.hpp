// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/report/scene.hpp"

namespace cairn::plot {

/// Where H has blocks, and where L has them in the order of the linear solver, of the first graph
/// with factors: {"name", "ordering", "H": PATTERN, "L": PATTERN}, where a PATTERN is
/// {"cells": n, "marked": ARRAY u8, "blocks": 12, "nonzeros": 108}, n x n cells row by row, 1 where
/// there is a block. Throws `Error` (usage) for a solver that does not say its order, (input) where
/// there is no such graph.
std::string sparsity_json(const Album& album, LinearSolver& solver);

}  // namespace cairn::plot
