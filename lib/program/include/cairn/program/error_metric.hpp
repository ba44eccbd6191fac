// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/graph/graph.hpp"
#include "cairn/program/session.hpp"
#include "cairn/program/table.hpp"

namespace cairn::app {

/// The error metric of a graph's factors (`FactorType::metric`), such as rotation_vector; empty
/// where none has a choice.
std::string metric_of(const Graph& graph);

/// Adds a row about it to a summary, if there is one. Where the command line did not choose it:
/// that it is the default, and how to have the one of earlier versions.
void add_metric(Table& table, const Graph& graph, const Session& session);

}  // namespace cairn::app
