// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include <pybind11/pybind11.h>

#include "cairn/runtime/result_fields.hpp"

namespace cairn::python {

namespace py = pybind11;

/// Makes attributes of the fields of a result (cairn/runtime/result_fields.hpp), each with its help
/// and its unit as docstring; `value` is that of a field of an object. "seconds.total" and
/// "seconds.solve" are one attribute, a dict. What the class has already stays as it is.
void add_attributes(const py::object& type, const std::vector<ResultField>& fields,
                    const std::function<ResultValue(py::handle self, std::size_t field)>& value);

/// A record as a dict, "chi2.final" as the member "final" of the dict "chi2".
py::object dict_of(const ResultRecord& record);

/// The fields of what `of` finds in an object, as it is when an attribute is read.
template <ResultStruct Struct, class Bound, class... More, class Of>
void bind_fields(py::class_<Bound, More...>& type, Of of) {
  const ResultFields<Struct>& fields = result_fields<Struct>();
  add_attributes(type, fields.all(), [&fields, of](py::handle self, std::size_t field) {
    const Struct& result = of(self.cast<const Bound&>());
    return fields.list().value(field, &result);
  });
}
template <ResultStruct Struct, class... More>
void bind_fields(py::class_<Struct, More...>& type) {
  bind_fields<Struct>(type, [](const Struct& result) -> const Struct& { return result; });
}

/// The fields of a result that was read before its graphs were moved away.
template <ResultStruct Struct, class Bound, class... More>
void bind_fields(py::class_<Bound, More...>& type, ResultRecord Bound::*record) {
  add_attributes(type, result_fields<Struct>().all(), [record](py::handle self, std::size_t field) {
    return (self.cast<const Bound&>().*record).values.at(field);
  });
}

}  // namespace cairn::python
