// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

#include "cairn/sparsification/sparsify_graph.hpp"

namespace cairn {

// What the sparsification of nodes and that of edges share.

/// Optimises `graph`, which messages call `what`, by the optimizer of that name, and notes in
/// `result` how that ended. Returns chi2 at the end.
double optimize_whole(Graph& graph, Optimizer& optimizer, const std::string& name,
                      const SparsifySetting& setting, const char* what, SparsifyResult& result);

/// Calls `measure` and returns true; where that ends with an `Error` of code numerical (a singular
/// graph), returns false, with a note in `result` that begins with `otherwise`.
bool measure_or_note(SparsifyResult& result, const char* otherwise,
                     const std::function<void()>& measure);

}  // namespace cairn
