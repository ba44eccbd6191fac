// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/nonzeros.hpp"

#include "cairn/linear/linearizer.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "cairn/runtime/result_fields.hpp"

namespace cairn {

Nonzeros count_nonzeros(const Graph& graph, LinearSolver& solver) {
  const NormalEquations equations(graph, solver);
  if (equations.size() == 0) return {};
  // H keeps its lower triangle, with whole blocks on the diagonal.
  const BlockStructure& structure = equations.H().structure();
  Nonzeros result{2 * structure.values(), solver.stats().factor_nonzeros};
  for (const std::int64_t size : structure.sizes()) result.information -= size * size;
  return result;
}

ResultFields<Nonzeros> Nonzeros::fields() {
  return ResultFields<Nonzeros>()
      .figure("information", &Nonzeros::information, "numbers in the blocks of H, both triangles")
      .figure("factor", &Nonzeros::factor, "numbers in its factor; 0: not known")
      .details();
}

}  // namespace cairn
