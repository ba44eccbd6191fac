// SPDX-License-Identifier: BSD-3-Clause
#include "graph_arrays.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <pybind11/pybind11.h>

#include "arrays.hpp"
#include "bulk.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/build.hpp"
#include "component_names.hpp"
#include "ids.hpp"
#include "measured.hpp"
#include "missing.hpp"
#include "types_of.hpp"

namespace cairn::python {
namespace {

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

/// An array of `rows` rows of `columns` numbers; one column may come without its dimension.
Doubles rows_of(const py::object& numbers, const char* what, std::size_t rows, int columns) {
  Doubles array = doubles_of(numbers, what);
  const bool fits =
      array.ndim() == 2
          ? array.shape(0) == static_cast<py::ssize_t>(rows) && array.shape(1) == columns
          : array.ndim() == 1 && columns == 1 && array.shape(0) == static_cast<py::ssize_t>(rows);
  if (!fits) {
    throw Error(ErrorCode::usage, fmt::format("{}: the shape is {}, expected ({}, {})", what,
                                              shape_text(array), rows, columns));
  }
  return array;
}

void add_variables_of(BoundGraph& bound, const py::object& type, const py::object& ids,
                      const py::object& states) {
  const GraphUse use(bound);
  const auto variable_type = variable_type_of(use.graph(), tag_of(type));
  const Ids names = ids_of(ids, "ids");
  const Doubles rows =
      rows_of(states, "states", span_of(names).size(), variable_type->ambient_size());
  check_new_ids(span_of(names));
  const py::gil_scoped_release unlocked;
  add_variables(use.graph(), variable_type, span_of(names), span_of(rows));
}

/// The type of factors; of a class of measurements, such as `cairn.Between`, the one that is on
/// variables such as the first row has.
std::shared_ptr<const FactorType> type_between(const Graph& graph, const py::object& given,
                                               const Ids& ids) {
  const std::vector<std::string> tags = tags_of_class(given);
  if (tags.size() < 2 || ids.size() == 0)
    return tags.size() == 1 ? factor_type_of(graph, tags.front()) : factor_type_of(graph, given);
  std::vector<std::string> joined;
  for (py::ssize_t k = 0; k < ids.shape(1); ++k)
    joined.emplace_back(graph.type(index_of(graph, ids.data()[k])).tag());
  for (const std::string& tag : tags) {
    auto type = factor_type_of(graph, tag);
    if (std::ranges::equal(type->variable_tags(), joined)) return type;
  }
  throw Error(ErrorCode::usage,
              fmt::format("ids[0]: no {} is on {}", given.attr("__name__").cast<std::string>(),
                          fmt::join(joined, " and ")));
}

void add_factors_of(BoundGraph& bound, const py::object& given_type, const py::object& ids,
                    const py::object& measurements, const py::object& information,
                    const py::object& sigmas, const py::object& loss) {
  const GraphUse use(bound);
  const Ids names = ids_of(ids, "ids", 2);
  const auto type = type_between(use.graph(), given_type, names);
  const std::size_t arity = size_of(type->arity());
  if (names.size() > 0 && names.shape(1) != type->arity()) {
    throw Error(ErrorCode::usage, fmt::format("ids: the shape is {}, and {} joins {} variables",
                                              shape_text(names), type->tag(), arity));
  }
  const std::size_t count = span_of(names).size() / arity;
  const Doubles rows = rows_of(measurements, "measurements", count, type->measurement_size());
  const std::vector<double> packed =
      Noise{sigmas, information, py::none()}.packed(type->residual_size(), count);
  const std::shared_ptr<const Loss> robust = loss_of(loss);
  const py::gil_scoped_release unlocked;
  add_factors(use.graph(), type, span_of(names), span_of(rows), packed, robust);
}

/// The pool of a type. Throws `Error` (usage) if the graph has none.
template <class Pools>
std::size_t pool_of(const Pools& pools, const std::string& tag) {
  const auto at =
      std::ranges::find_if(pools, [&](const auto& pool) { return pool.type->tag() == tag; });
  if (at == pools.end()) throw Error(ErrorCode::usage, "there is no " + tag + " in the graph");
  return static_cast<std::size_t>(at - pools.begin());
}

/// "states()": of which type?
template <class Pools>
void refuse_no_type(const Pools& pools, const py::object& type) {
  if (!type.is_none()) return;
  std::vector<std::string> tags;
  for (const auto& pool : pools) tags.emplace_back(pool.type->tag());
  throw py::type_error(
      fmt::format("of which type? Give its tag or class; the graph has {}",
                  tags.empty() ? "none" : fmt::format("{}", fmt::join(tags, ", "))));
}

py::array_t<Id> ids_of_type(BoundGraph& bound, const py::object& type) {
  const Graph& graph = bound.get();
  std::vector<Id> ids;
  if (type.is_none()) {
    for (int v = 0; v < graph.variable_count(); ++v) ids.push_back(graph.id(v));
  } else {
    const VariablePool& pool =
        graph.variable_pools()[pool_of(graph.variable_pools(), tag_of(type))];
    for (const int v : pool.variables) ids.push_back(graph.id(v));
  }
  return py::array_t<Id>(static_cast<py::ssize_t>(ids.size()), ids.data());
}

void set_states(BoundGraph& bound, const py::object& type, const py::object& states,
                const py::object& ids) {
  Graph& graph = bound.get();
  const VariablePool& pool = graph.variable_pools()[pool_of(graph.variable_pools(), tag_of(type))];
  std::vector<int> variables(pool.variables.begin(), pool.variables.end());
  if (!ids.is_none()) {
    variables.clear();
    const Ids names = ids_of(ids, "ids");
    for (const Id id : span_of(names)) {
      const auto v = graph.find(id);
      if (!v || graph.type_of(*v) != pool.type) {
        throw MissingKey(fmt::format("there is no {} {} in the graph", pool.type->tag(), id));
      }
      variables.push_back(*v);
    }
  }
  const std::size_t size = size_of(pool.type->ambient_size());
  const Doubles rows = rows_of(states, "states", variables.size(), pool.type->ambient_size());
  const Values before = graph.values();
  try {
    for (std::size_t k = 0; k < variables.size(); ++k)
      graph.set_state(variables[k], span_of(rows).subspan(k * size, size));
  } catch (const Error&) {
    graph.set_values(before);
    throw;
  }
}

const FactorPool& factor_pool_of(BoundGraph& bound, const py::object& type) {
  const std::vector<FactorPool>& pools = bound.get().factor_pools();
  refuse_no_type(pools, type);
  std::vector<std::string> tags = tags_of_class(type);
  std::erase_if(tags, [&](const std::string& tag) {
    return std::ranges::none_of(pools, [&](const auto& pool) { return pool.type->tag() == tag; });
  });
  return pools[pool_of(pools, tags.size() == 1 ? tags.front() : tag_of(type))];
}

py::array_t<Id> factor_ids(BoundGraph& bound, const py::object& type) {
  const FactorPool& pool = factor_pool_of(bound, type);
  py::array_t<Id> ids(
      {static_cast<py::ssize_t>(pool.size()), static_cast<py::ssize_t>(pool.type->arity())});
  std::ranges::transform(pool.variables, ids.mutable_data(),
                         [&](int v) { return bound.get().id(v); });
  return ids;
}

py::array_t<double> measurements_of(BoundGraph& bound, const py::object& type) {
  const FactorPool& pool = factor_pool_of(bound, type);
  return array_of(pool.measurements, {pool.size(), size_of(pool.type->measurement_size())});
}

py::array_t<double> information_of(BoundGraph& bound, const py::object& type) {
  const FactorPool& pool = factor_pool_of(bound, type);
  const int n = pool.type->residual_size();
  std::vector<double> dense;
  for (std::size_t k = 0; k < pool.size(); ++k) {
    const Eigen::MatrixXd A = unpack(bound.get().information(pool.sequence[k]), n);
    dense.insert(dense.end(), A.data(), A.data() + A.size());
  }
  return array_of(dense, {pool.size(), size_of(n), size_of(n)});
}

py::array_t<std::int32_t> positions_of(BoundGraph& bound, const py::object& type) {
  const GrowingArray<std::int32_t>& sequence = factor_pool_of(bound, type).sequence;
  return py::array_t<std::int32_t>(static_cast<py::ssize_t>(sequence.size()), sequence.data());
}

}  // namespace

py::array_t<double> states_of(const Graph& graph, const Values& values, const py::object& type) {
  refuse_no_type(graph.variable_pools(), type);
  const std::size_t p = pool_of(graph.variable_pools(), tag_of(type));
  const VariablePool& pool = graph.variable_pools()[p];
  return array_of(values.pools[p], {pool.variables.size(), size_of(pool.type->ambient_size())});
}

void bind_graph_arrays(py::class_<BoundGraph>& graph) {
  graph
      .def("add_variables", &add_variables_of, py::arg("type"), py::arg("ids"), py::arg("states"),
           R"(Adds n variables of one type at once; all or, with an Error, none.

type: its tag, such as "VERTEX_SE2", or a class, such as cairn.Pose2.
ids: (n,) integers.
states: a list of Pose2 and the like, or (n, m) numbers as files have them: x y theta of a Pose2, x y z qx qy qz qw of a Pose3, coordinates of points.)")
      .def("add_factors", &add_factors_of, py::arg("type"), py::arg("ids"), py::arg("measurements"),
           py::arg("information") = py::none(), py::kw_only(), py::arg("sigmas") = py::none(),
           py::arg("loss") = py::none(),
           R"(Adds n factors of one type at once; all or, with an Error, none.

type: its tag, such as "EDGE_SE2", a FactorType, or a class, such as cairn.Between: then the variables say which type.
ids: (n, arity) integers, the variables of each factor.
measurements: (n, m) numbers, or a list of Pose2 and the like.
information: (n, r, r), or (r, r) for all, or (n, r(r+1)/2) upper triangles row by row; or
sigmas: (n, r) standard deviations, or (r,) or one number for all.
loss: a robust loss for each of them, such as "huber:scale=1".)")
      .def("ids", &ids_of_type, py::arg("type") = py::none(),
           "Ids of all variables, or of those of a type, in the order of addition: (n,) integers.")
      .def(
          "states",
          [](BoundGraph& bound, const py::object& type) {
            return states_of(bound.get(), bound.get().values(), type);
          },
          py::arg("type") = py::none(),
          "The estimates of all variables of a type, in the order of `ids(type)`: (n, m) numbers.")
      .def("set_states", &set_states, py::arg("type"), py::arg("states"),
           py::arg("ids") = py::none(),
           "Replaces the estimates of all variables of a type, or of those with the given ids, in "
           "that order.")
      .def("factor_ids", &factor_ids, py::arg("type") = py::none(),
           "The variables of all factors of a type, by id: (n, arity) integers.")
      .def("measurements", &measurements_of, py::arg("type") = py::none(),
           "The measurements of all factors of a type: (n, m) numbers.")
      .def("information", &information_of, py::arg("type") = py::none(),
           "The information matrices of all factors of a type: (n, r, r) numbers.")
      .def("positions", &positions_of, py::arg("type") = py::none(),
           "The positions of all factors of a type among all factors: (n,) integers.");
}

}  // namespace cairn::python
