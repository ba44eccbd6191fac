// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

#include "bound_graph.hpp"

namespace cairn::python {

namespace py = pybind11;

/// `pickle` of graphs, and with it `multiprocessing`: all but types and losses that no other
/// process could know, which are an Error.
void bind_pickles(py::class_<BoundGraph>& graph);

/// Of all classes of the module: every protocol of pickles works, or is a TypeError.
void take_all_protocols(py::module_& module);

}  // namespace cairn::python
