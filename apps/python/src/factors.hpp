// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <pybind11/pybind11.h>

#include "cairn/graph/elements.hpp"
#include "measured.hpp"

/// `cairn.Factor`: a measurement with its noise and its loss, as one value.
namespace cairn::python {

namespace py = pybind11;

/// Its type is that of the registry, or the measurement's own. Throws `Error`.
Factor factor_of(const Measured& measured, const Noise& noise, const py::object& loss);

/// What a Python object gives: None no factor, a `cairn.Factor` one, any iterable of them several.
/// Throws `Error` (usage), which names `what`, for anything else.
std::vector<Factor> factors_of(const py::object& given, const char* what);

}  // namespace cairn::python
