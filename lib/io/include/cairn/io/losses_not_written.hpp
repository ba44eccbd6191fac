// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What to say when a graph is written: a sentence where factors have robust losses, which no
/// format has, so that a graph that is read has none; empty else.
CAIRN_API std::string losses_not_written(const Graph& graph);

}  // namespace cairn
