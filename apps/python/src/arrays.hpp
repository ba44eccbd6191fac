// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "cairn/graph/elements.hpp"

/// NumPy arrays as the rest of cairn takes and gives numbers.
namespace cairn::python {

namespace py = pybind11;

/// Doubles, row by row: an array that has this form is used as it is, any other converted.
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Ids = py::array_t<Id, py::array::c_style | py::array::forcecast>;

inline std::span<const double> span_of(const Doubles& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}
inline std::span<const Id> span_of(const Ids& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

/// Ids of any sequence of integers. Throws `Error` (usage), which names `what`, for numbers that
/// are not integers, and for another number of dimensions than `dimensions`.
Ids ids_of(const py::object& sequence, const std::string& what, int dimensions = 1);

/// Whether it is a single id, an `int` or an integer of NumPy, instead of several.
bool is_one_id(const py::object& ids);
/// The same of one id as well.
Ids one_or_several(const py::object& ids, const std::string& what);

/// Doubles of any sequence of numbers. Throws `Error` (usage), which names `what`.
Doubles doubles_of(const py::object& sequence, const std::string& what);

/// A copy of the numbers, row by row, in that shape.
py::array_t<double> array_of(std::span<const double> numbers,
                             std::initializer_list<std::size_t> shape);
inline py::array_t<double> array_of(std::span<const double> numbers) {
  return array_of(numbers, {numbers.size()});
}

/// Ids: (n,) integers.
inline py::array_t<Id> array_of_ids(std::span<const Id> ids) {
  return py::array_t<Id>(static_cast<py::ssize_t>(ids.size()), ids.data());
}

/// count blocks of rows × columns, one after the other and column-major each (as cairn has them),
/// as an array (count, rows, columns).
py::array_t<double> blocks_of(std::span<const double> blocks, std::size_t rows,
                              std::size_t columns);

/// "(3, 4)", for messages.
std::string shape_text(const py::array& array);

}  // namespace cairn::python
