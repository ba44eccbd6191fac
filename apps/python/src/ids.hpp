// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>

#include "cairn/graph/elements.hpp"

/// Ids of variables and classes of measurements as Python code gives them.
namespace cairn::python {

namespace py = pybind11;

/// Throws `Error` (usage) unless they can be ids of new variables: those of files are from 0.
void check_new_ids(std::span<const Id> ids);
inline void check_new_id(Id id) { check_new_ids({&id, 1}); }

/// The tags of the factor types whose measurements are of this class, such as `cairn.Between`; none
/// for anything else.
std::vector<std::string> tags_of_class(const py::object& type);

/// "str", "tuple", "Pose2": for messages.
std::string type_name(const py::object& object);

/// Throws `TypeError` for anything but an integer, and for the text of a symbol names the function.
void refuse_id_that_is_none(const py::object& id);

/// For calls of `add` that fit no overload: throws `TypeError`, which says what it takes.
[[noreturn]] void refuse_added(const py::args& arguments, const py::kwargs& named);

}  // namespace cairn::python
