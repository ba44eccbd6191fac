// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

/// The Python module `cairn._cairn`: cairn's libraries as Python sees them. What is computed is
/// computed there; here arguments are checked and converted, and the interpreter's lock is released
/// while C++ works.
namespace cairn::python {

namespace py = pybind11;

// Each adds the classes and functions of one subject to the module; in this order, in which each
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
void bind_policy(py::module_& module);
void bind_compact(py::module_& module);
void bind_sparsify(py::module_& module);
void bind_floors(py::module_& module);
void bind_situation(py::module_& module);
void bind_exploration(py::module_& module);
void bind_pictures(py::module_& module);
void bind_components(py::module_& module);

/// After these: using an object that `__new__` has made without `__init__` is a TypeError.
void refuse_objects_without_init(py::module_& module);

}  // namespace cairn::python
