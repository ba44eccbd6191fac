// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "bound_graph.hpp"

namespace cairn::python {

/// The methods of `cairn.Graph` that take or give all variables or factors of a type.
void bind_graph_arrays(pybind11::class_<BoundGraph>& graph);

/// The states of all variables of a type at `values`, (n, ambient size). Throws `Error` (usage) if
/// the graph has none.
pybind11::array_t<double> states_of(const Graph& graph, const Values& values,
                                    const pybind11::object& type);

}  // namespace cairn::python
