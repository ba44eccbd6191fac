// SPDX-License-Identifier: BSD-3-Clause
#include "arrays.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn::python {
namespace {

/// A list of values such as `Pose2` as one of their states: NumPy takes objects that turn into
/// arrays, but are no sequences, with a warning.
py::object with_states(const py::object& given) {
  if (!py::isinstance<py::list>(given) && !py::isinstance<py::tuple>(given)) return given;
  const auto is_value = [](const py::handle one) { return py::hasattr(one, "from_state"); };
  if (py::len(given) == 0 || !is_value(given[py::int_(0)])) return given;
  py::list states;
  for (const py::handle one : given)
    states.append(is_value(one) ? py::object(one.attr("state"))
                                : py::reinterpret_borrow<py::object>(one));
  return states;
}

/// NumPy drops the mask of an array that has one, and turns times and complex numbers into others.
void refuse_what_is_no_number(const py::object& given, const char* what) {
  if (py::hasattr(given, "mask") && py::hasattr(given, "filled") &&
      py::module_::import("numpy").attr("any")(given.attr("mask")).cast<bool>()) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: some entries are masked; fill them, or leave them out", what));
  }
  if (!py::isinstance<py::array>(given)) return;
  const char kind = py::reinterpret_borrow<py::array>(given).dtype().kind();
  if (kind == 'M' || kind == 'm' || kind == 'c') {
    throw Error(ErrorCode::usage,
                fmt::format("{}: expected numbers, not {}", what,
                            kind == 'c' ? "complex ones" : "times; divide by a unit of time"));
  }
}

}  // namespace

bool is_one_id(const py::object& ids) {
  return PyIndex_Check(ids.ptr()) != 0 && !py::isinstance<py::array>(ids);
}

Ids one_or_several(const py::object& ids, const std::string& what) {
  return ids_of(is_one_id(ids) ? py::make_tuple(ids) : ids, what);
}

Ids ids_of(const py::object& sequence, const std::string& what, int dimensions) {
  refuse_what_is_no_number(sequence, what.c_str());
  const py::array numbers = py::array::ensure(sequence);
  if (!numbers) {
    PyErr_Clear();
    throw Error(ErrorCode::usage, fmt::format("{}: expected integers", what));
  }
  const char kind = numbers.dtype().kind();
  if (numbers.size() > 0 && kind != 'i' && kind != 'u') {
    throw Error(ErrorCode::usage, fmt::format("{}: expected integers, not numbers of type {}", what,
                                              std::string(py::str(numbers.dtype()))));
  }
  if (kind == 'u' && numbers.itemsize() == sizeof(std::uint64_t)) {
    const auto whole = py::array_t<std::uint64_t, py::array::c_style>::ensure(numbers);
    const std::span<const std::uint64_t> all(whole.data(), static_cast<std::size_t>(whole.size()));
    const auto large = std::ranges::find_if(all, [](std::uint64_t id) {
      return id > static_cast<std::uint64_t>(std::numeric_limits<Id>::max());
    });
    if (large != all.end())
      throw Error(ErrorCode::usage, fmt::format("{}: {} is larger than any id", what, *large));
  }
  if (numbers.ndim() != dimensions && numbers.size() > 0) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: the shape is {}, expected {} dimension{}", what,
                            shape_text(numbers), dimensions, dimensions == 1 ? "" : "s"));
  }
  return Ids::ensure(numbers);
}

Doubles doubles_of(const py::object& given, const std::string& what) {
  const py::object sequence = with_states(given);
  // As what they are first: of a list, the type is known only then.
  const py::object any =
      py::isinstance<py::array>(sequence) ? sequence : py::object(py::array::ensure(sequence));
  Doubles numbers;
  if (any) {
    refuse_what_is_no_number(sequence, what.c_str());
    refuse_what_is_no_number(any, what.c_str());
    numbers = Doubles::ensure(any);
  }
  if (!numbers) {
    PyErr_Clear();
    throw Error(ErrorCode::usage, fmt::format("{}: expected numbers", what));
  }
  return numbers;
}

py::array_t<double> array_of(std::span<const double> numbers,
                             std::initializer_list<std::size_t> shape) {
  py::array_t<double> array(std::vector<py::ssize_t>(shape.begin(), shape.end()));
  std::ranges::copy(numbers, array.mutable_data());
  return array;
}

py::array_t<double> blocks_of(std::span<const double> blocks, std::size_t rows,
                              std::size_t columns) {
  const std::size_t size = rows * columns;
  const std::size_t count = size == 0 ? 0 : blocks.size() / size;
  py::array_t<double> array(std::vector<py::ssize_t>{static_cast<py::ssize_t>(count),
                                                     static_cast<py::ssize_t>(rows),
                                                     static_cast<py::ssize_t>(columns)});
  double* out = array.mutable_data();
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t column = 0; column < columns; ++column)
        *out++ = blocks[k * size + column * rows + row];
    }
  }
  return array;
}

std::string shape_text(const py::array& array) {
  return std::string(py::str(py::tuple(array.attr("shape"))));
}

}  // namespace cairn::python
