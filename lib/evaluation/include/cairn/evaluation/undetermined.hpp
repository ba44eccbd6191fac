// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Adds what the measurements leave free at the graph's states (`FreeDirections::describe`), unless
/// it is among the notes already. It is no doubt about what is determined.
CAIRN_API void note_what_is_free(const Graph& graph, std::vector<std::string>& notes);

}  // namespace cairn
