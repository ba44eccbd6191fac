// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <string>

#include "cairn/geometry/loop_closures.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/sparsification/edge_selection.hpp"
#include "cairn/sparsification/sparsify_graph.hpp"

namespace cairn {

/// Which components choose the loop closures that stay.
struct SparsifyEdgesJob {
  ComponentSpec selection;  ///< an `EdgeSelection`
  ComponentSpec optimizer;
  std::string linear_solver = "block_cholesky";  ///< for determinants and eigenvalues
  bool as_given = false;                         ///< the graph is at its minimum
  bool measure = true;                           ///< KLD, RMSE and algebraic connectivity
  ComparedAt compared_at = ComparedAt::common;   ///< for the KLD
};

/// Algebraic connectivity of the relative factors; NaN: not defined, since they do not connect all
/// poses, or have no part of that kind.
struct Connectivity {
  double full = std::nan("");    ///< with all factors
  double sparse = std::nan("");  ///< with those that stay, of the same weights
  double bound = std::nan("");   ///< of any choice of as many, where the selection knows it

  CAIRN_API static ResultFields<Connectivity> fields();
};

struct SparsifyEdgesResult {
  SparsifyResult whole;  ///< the sparse graph at its minimum, and its distance from the original
  LoopClosures closures;
  EdgeChoice choice;
  std::array<Connectivity, 2> connectivity;  ///< by `EdgeWeight`

  CAIRN_API static ResultFields<SparsifyEdgesResult> fields();
};

/// Optimises a whole graph, removes loop closures from it (`find_loop_closures`), optimises what is
/// left, and measures what was lost. All variables and all other factors stay, and factors that
/// stay keep their information: so the sparse graph has no information that the original has not.
/// Throws `Error` for names and options that there are not, and (input) for a graph without loop
/// closures.
CAIRN_API SparsifyEdgesResult sparsify_edges(const Graph& graph, const SparsifyEdgesJob& job,
                                             const SparsifySetting& setting);

}  // namespace cairn
