// SPDX-License-Identifier: BSD-3-Clause
#include "ids.hpp"

#include <algorithm>
#include <optional>

#include <fmt/core.h>
#include <pybind11/stl.h>

#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "measured.hpp"
#include "missing.hpp"

namespace cairn::python {

void check_new_ids(std::span<const Id> ids) {
  const auto below = std::ranges::find_if(ids, [](Id id) { return id < 0; });
  if (below == ids.end()) return;
  throw Error(ErrorCode::usage,
              fmt::format("the id {} is below 0: ids are from 0, as in files", *below));
}

int index_of(const Graph& graph, Id id) {
  if (const auto index = graph.find(id)) return *index;
  throw MissingKey("there is no variable " + id_text(id) + " in the graph");
}

std::string type_name(const py::object& object) {
  return py::type::of(object).attr("__name__").cast<std::string>();
}

std::vector<std::string> tags_of_class(const py::object& type) {
  if (!py::isinstance<py::type>(type) || !py::hasattr(type, "tags")) return {};
  const py::object tags = type.attr("tags");
  if (!py::isinstance<py::tuple>(tags)) return {};
  return tags.cast<std::vector<std::string>>();
}

void refuse_id_that_is_none(const py::object& id) {
  if (PyIndex_Check(id.ptr()) != 0) return;
  std::string text = fmt::format("an id is an integer, not a {}", type_name(id));
  if (py::isinstance<py::str>(id)) {
    const auto given = id.cast<std::string>();
    const std::optional<Id> meant = id_from_text(given);
    text = fmt::format("an id is an integer, not the text '{}'", given);
    if (const auto symbol = meant ? as_symbol(*meant) : std::nullopt)
      text +=
          fmt::format("; cairn.symbol('{}', {}) makes one of it", symbol->letter, symbol->index);
  }
  throw py::type_error(text);
}

void refuse_added(const py::args& arguments, const py::kwargs& named) {
  const char* const expected =
      "add takes an id and a value, add(0, Pose2()), a measurement with its noise by name, "
      "add(Between(0, 1, Pose2(1, 0, 0)), sigmas=0.1), or a cairn.Factor";
  const bool is_named = named.contains("fixed");
  if (is_named || arguments.size() > 2) {
    // What has to be converted first, such as fixed=1, pybind11 tries after this.
    const py::object fixed = is_named ? py::object(named["fixed"]) : py::object(arguments[2]);
    if (!py::isinstance<py::bool_>(fixed)) throw py::reference_cast_error();
  }
  if (!arguments.empty()) {
    const py::object first = arguments[0];
    const bool is_measured = py::isinstance<Measured>(first);
    if (!is_measured && !py::hasattr(first, "from_state") && arguments.size() + named.size() > 1)
      refuse_id_that_is_none(first);
  }
  throw py::type_error(expected);
}

}  // namespace cairn::python
