// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/sparsification/sparsify_graph.hpp"

namespace cairn {

// What the sparsification of nodes and that of edges share.

/// Optimises `graph`, which messages call `what`, by the optimizer of that name, and notes in
/// `result` how that ended. Returns chi2 at the end.
double optimize_whole(Graph& graph, Optimizer& optimizer, const std::string& name,
                      const SparsifySetting& setting, const char* what, SparsifyResult& result);

/// Sets `result.error`, the distance of `result.sparse` from `original`; a note where there is
/// none.
void measure_whole(const Graph& original, LinearSolver& solver, ComparedAt at,
                   SparsifyResult& result);

}  // namespace cairn
