// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

/// The Python module `cairn._cairn`: cairn's libraries as Python sees them. What is computed is
/// computed there; here arguments are checked and converted, and the interpreter's lock is released
/// while C++ works.
namespace cairn::python {

namespace py = pybind11;

// Each adds the classes and functions of one part to the module; in this order, in which each
// uses the classes of those before it.
void bind_errors(py::module_& module);
void bind_values(py::module_& module);
void bind_factor_types(py::module_& module);
void bind_measurements(py::module_& module);
void bind_factors(py::module_& module);
void bind_graph(py::module_& module);
void bind_files(py::module_& module);
void bind_optimize(py::module_& module);
void bind_covariances(py::module_& module);
void bind_estimates(py::module_& module);
void bind_estimator(py::module_& module);
void bind_evaluation(py::module_& module);
void bind_pictures(py::module_& module);
/// What the subjects add, each after those that it needs; written by CMake (cairn_add_python).
void bind_subjects(py::module_& module);
void bind_components(py::module_& module);

/// After these: using an object that `__new__` has made without `__init__` is a TypeError.
void refuse_objects_without_init(py::module_& module);

}  // namespace cairn::python
