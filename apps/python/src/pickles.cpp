// SPDX-License-Identifier: BSD-3-Clause
// Pickles of cairn.Graph: its contents as arrays, so that processes can pass graphs to each other.
#include "pickles.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "component_names.hpp"
#include "missing.hpp"

namespace cairn::python {
namespace {

constexpr int kVersion = 1;

using Indices = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;

std::size_t size_of(int n) { return static_cast<std::size_t>(n); }

/// By its tag another process finds the type, if it is the registry's.
template <class Type>
void expect_registered(const std::shared_ptr<const Type>& type, const char* kind,
                       const std::shared_ptr<const Type>& registered) {
  if (type == registered) return;
  throw Error(ErrorCode::usage,
              fmt::format("a graph with the {} type {} cannot be pickled: it is not known by its "
                          "tag; cairn.register makes a FactorType known, in the process that reads "
                          "the pickle too",
                          kind, type->tag()));
}

template <class Type, class Find>
std::shared_ptr<const Type> registered(const char* kind, std::string_view tag, const Find& find) {
  return default_registry().has(kind, tag) ? find() : nullptr;
}

py::tuple variables_of(const Graph& graph, const VariablePool& pool,
                       std::span<const double> states) {
  const std::string_view tag = pool.type->tag();
  expect_registered<VariableType>(pool.type, "variable",
                                  registered<VariableType>("variable", tag, [&] {
                                    return default_registry().variable_type(tag);
                                  }));
  std::vector<Id> ids;
  std::vector<bool> fixed;
  for (const int v : pool.variables) {
    ids.push_back(graph.id(v));
    fixed.push_back(graph.fixed(v));
  }
  return py::make_tuple(
      std::string(tag), Indices(static_cast<py::ssize_t>(ids.size()), pool.variables.data()),
      array_of_ids(ids), array_of(states, {ids.size(), size_of(pool.type->ambient_size())}), fixed);
}

py::tuple factors_of(const Graph& graph, const FactorPool& pool) {
  const std::string_view tag = pool.type->tag();
  expect_registered<FactorType>(pool.type, "factor", registered<FactorType>("factor", tag, [&] {
                                  return default_registry().factor_type(tag);
                                }));
  std::vector<double> information;
  std::vector<Id> ids;
  py::list losses;
  for (std::size_t k = 0; k < pool.size(); ++k) {
    const int f = pool.sequence[k];
    const std::span<const double> one = graph.information(f);
    information.insert(information.end(), one.begin(), one.end());
    for (const int v : graph.factor_variables(f)) ids.push_back(graph.id(v));
    losses.append(name_of_loss(graph.loss(f)));
  }
  const auto count = static_cast<py::ssize_t>(pool.size());
  return py::make_tuple(std::string(tag), Indices(count, pool.sequence.data()), array_of_ids(ids),
                        array_of(pool.measurements), array_of(information), losses);
}

/// One variable or factor among all: which entry of which list comes next.
struct Place {
  py::ssize_t pool = -1, entry = 0;
};

/// Entries of all pools in the order in which they were added.
std::vector<Place> in_order(const py::list& pools) {
  std::vector<Place> places;
  py::ssize_t p = 0;
  for (const py::handle pool : pools) {
    const auto positions = pool.cast<py::tuple>()[1].cast<Indices>();
    for (py::ssize_t k = 0; k < positions.size(); ++k) {
      const auto at = static_cast<std::size_t>(positions.data()[k]);
      if (at >= places.size()) places.resize(at + 1);
      places[at] = {p, k};
    }
    ++p;
  }
  for (const Place& place : places) {
    if (place.pool < 0) throw Error(ErrorCode::input, "the pickle of a graph is damaged");
  }
  return places;
}

/// Number `k` of rows that are one after the other.
std::span<const double> row(std::span<const double> rows, py::ssize_t k, std::size_t size) {
  return rows.subspan(static_cast<std::size_t>(k) * size, size);
}

void add_variables(Graph& graph, const py::list& pools) {
  struct Pool {
    std::shared_ptr<const VariableType> type;
    Ids ids;
    Doubles states;
    std::vector<bool> fixed;
  };
  std::vector<Pool> all;
  for (const py::handle handle : pools) {
    const auto pool = handle.cast<py::tuple>();
    all.push_back({default_registry().variable_type(pool[0].cast<std::string>()),
                   pool[2].cast<Ids>(), pool[3].cast<Doubles>(),
                   pool[4].cast<std::vector<bool>>()});
  }
  for (const Place& place : in_order(pools)) {
    const Pool& pool = all[static_cast<std::size_t>(place.pool)];
    const int v = graph.add_variable(
        pool.type, pool.ids.data()[place.entry],
        row(span_of(pool.states), place.entry, size_of(pool.type->ambient_size())));
    if (pool.fixed[static_cast<std::size_t>(place.entry)]) graph.set_fixed(v);
  }
}

void add_factors(Graph& graph, const py::list& pools) {
  struct Pool {
    std::shared_ptr<const FactorType> type;
    Ids ids;
    Doubles measurements, information;
    py::list losses;
  };
  std::vector<Pool> all;
  for (const py::handle handle : pools) {
    const auto pool = handle.cast<py::tuple>();
    all.push_back({default_registry().factor_type(pool[0].cast<std::string>()), pool[2].cast<Ids>(),
                   pool[3].cast<Doubles>(), pool[4].cast<Doubles>(), pool[5].cast<py::list>()});
  }
  for (const Place& place : in_order(pools)) {
    const Pool& pool = all[static_cast<std::size_t>(place.pool)];
    const std::size_t arity = size_of(pool.type->arity());
    std::vector<int> variables;
    for (std::size_t i = 0; i < arity; ++i)
      variables.push_back(
          index_of(graph, pool.ids.data()[static_cast<std::size_t>(place.entry) * arity + i]));
    const auto size = static_cast<std::size_t>(pool.information.size()) / py::len(pool.losses);
    graph.add_factor(
        pool.type, variables,
        row(span_of(pool.measurements), place.entry, size_of(pool.type->measurement_size())),
        row(span_of(pool.information), place.entry, size), loss_of(pool.losses[place.entry]));
  }
}

py::tuple pickled(BoundGraph& bound) {
  const Graph& graph = bound.get();
  py::list variables, factors;
  for (std::size_t p = 0; p < graph.variable_pools().size(); ++p)
    variables.append(variables_of(graph, graph.variable_pools()[p], graph.values().pools[p]));
  for (const FactorPool& pool : graph.factor_pools()) {
    if (pool.size() > 0) factors.append(factors_of(graph, pool));
  }
  return py::make_tuple(kVersion, variables, factors, bound.stamps, bound.notes);
}

std::unique_ptr<BoundGraph> restored(const py::tuple& state) {
  if (state.empty() || state[0].cast<int>() != kVersion)
    throw Error(ErrorCode::input, "the pickle of a graph is of another version of cairn");
  Graph graph;
  add_variables(graph, state[1].cast<py::list>());
  add_factors(graph, state[2].cast<py::list>());
  auto bound = std::make_unique<BoundGraph>(std::move(graph));
  bound->stamps = state[3].cast<std::vector<double>>();
  bound->notes = state[4].cast<std::vector<std::string>>();
  return bound;
}

/// With the protocols before the second, Python would make an object of a base class that cannot be
/// made, which ends the process.
py::object reduced(const py::object& self, int protocol) {
  return py::handle(reinterpret_cast<PyObject*>(&PyBaseObject_Type))
      .attr("__reduce_ex__")(self, std::max(protocol, 2));
}

}  // namespace

void bind_pickles(py::class_<BoundGraph>& graph) { graph.def(py::pickle(&pickled, &restored)); }

void take_all_protocols(py::module_& module) {
  for (const auto& [name, member] : module.attr("__dict__").cast<py::dict>()) {
    if (!py::isinstance<py::type>(member)) continue;
    if (!py::detail::get_type_info(reinterpret_cast<PyTypeObject*>(member.ptr()))) continue;
    member.attr("__reduce_ex__") =
        py::cpp_function(&reduced, py::name("__reduce_ex__"), py::is_method(member));
  }
}

}  // namespace cairn::python
