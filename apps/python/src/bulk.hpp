// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>

#include "cairn/graph/graph.hpp"

/// Many variables or factors of one type from arrays. All or nothing: an `Error` leaves the graph
/// as it was.
namespace cairn::python {

/// states: ids.size() × ambient size, row by row.
void add_variables(Graph& graph, const std::shared_ptr<const VariableType>& type,
                   std::span<const Id> ids, std::span<const double> states);

/// ids: count × arity; measurements: count × measurement size; information: count × n(n+1)/2, the
/// upper triangles row by row, or one of them for all.
void add_factors(Graph& graph, const std::shared_ptr<const FactorType>& type,
                 std::span<const Id> ids, std::span<const double> measurements,
                 std::span<const double> information, const std::shared_ptr<const Loss>& loss);

}  // namespace cairn::python
