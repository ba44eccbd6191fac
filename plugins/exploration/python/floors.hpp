// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

#include "cairn/grid/grid.hpp"

namespace cairn::python {

namespace py = pybind11;

/// A floor as `cairn.explore` takes it: a `cairn.Floor`; the name of a file; "@rooms:seed=3", a
/// floor plan with its options. Throws `TypeError` for anything else.
OccupancyGrid floor_of(const py::object& given);

}  // namespace cairn::python
