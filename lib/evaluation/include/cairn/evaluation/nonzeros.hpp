// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "cairn/graph/graph.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// How dense a graph's normal equations are.
struct Nonzeros {
  std::int64_t information = 0;  ///< numbers in the blocks of H, both triangles
  std::int64_t factor = 0;       ///< in L, in the solver's ordering; 0: the solver does not count

  CAIRN_API static ResultFields<Nonzeros> fields();
};

/// Counts them; nothing is factorised. None where no variable is free.
CAIRN_API Nonzeros count_nonzeros(const Graph& graph, LinearSolver& solver);

}  // namespace cairn
