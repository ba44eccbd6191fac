// SPDX-License-Identifier: BSD-3-Clause
// Objects that __new__ has made, and __init__ has not.
#include <cstddef>

#include <pybind11/pybind11.h>

#include "bindings.hpp"

namespace cairn::python {
namespace {

/// Where an object is used that has no C++ object, pybind11 takes memory for one with this, and
/// would go on with what lies in there.
void* refuse(std::size_t) {
  throw py::type_error("__init__ of this object was never called: make it by calling its class");
}

}  // namespace

void refuse_objects_without_init(py::module_& module) {
  for (const auto& [name, member] : module.attr("__dict__").cast<py::dict>()) {
    if (!py::isinstance<py::type>(member)) continue;
    auto* const type = reinterpret_cast<PyTypeObject*>(member.ptr());
    if (py::detail::type_info* const info = py::detail::get_type_info(type))
      info->operator_new = &refuse;
  }
}

}  // namespace cairn::python
