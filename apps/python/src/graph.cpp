// SPDX-License-Identifier: BSD-3-Clause
// cairn.Graph: one by one, what it holds, and its copies. Arrays are in graph_arrays.cpp.
#include "cairn/graph/graph.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/build.hpp"
#include "cairn/typed/print.hpp"
#include "component_names.hpp"
#include "graph_arrays.hpp"
#include "ids.hpp"
#include "measured.hpp"
#include "missing.hpp"
#include "pickles.hpp"
#include "types_of.hpp"

namespace cairn::python {
namespace {

const char* const kDoc =
    R"(A factor graph: variables and factors, and an estimate.

A variable is known by its id, an integer. Lengths are metres, angles radians, unless a type says otherwise. What it
returns are copies; calls that change the graph while another thread optimises it are refused.

    graph = cairn.Graph()
    graph.add(0, cairn.Pose2(), fixed=True)
    graph.add(1, cairn.Pose2(1, 0, 0))
    graph.add(cairn.Between(0, 1, cairn.Pose2(1.1, 0, 0)), sigmas=[0.1, 0.1, 0.05]))";

int add_variable(BoundGraph& bound, Id id, const py::object& value, bool fixed,
                 const py::object& type) {
  Graph& graph = bound.get();
  check_new_id(id);
  const Doubles state = doubles_of(value, "value");
  const std::string tag = tag_of(type.is_none() ? value : type);
  const int index = graph.add_variable(variable_type_of(graph, tag), id, span_of(state));
  if (fixed) graph.set_fixed(index);
  return index;
}

int add_measurement(BoundGraph& bound, const Measured& measured, const py::object& sigmas,
                    const py::object& information, const py::object& covariance,
                    const py::object& loss) {
  Graph& graph = bound.get();
  auto type = measured.own ? measured.own : factor_type_of(graph, measured.tag);
  const Noise noise{sigmas, information, covariance};
  std::vector<double> packed = noise.packed(type->residual_size());
  return graph.add(
      Factor{std::move(type), measured.ids, measured.numbers, std::move(packed), loss_of(loss)});
}

/// The estimate of a variable as the value that its type stands for, else its numbers.
py::object value_at(BoundGraph& bound, Id id) {
  const Graph& graph = bound.get();
  const int index = index_of(graph, id);
  return value_of(graph.type(index), graph.state(index));
}

Measured measured_at(BoundGraph& bound, int position) {
  const Graph& graph = bound.get();
  if (position < 0 || position >= graph.factor_count()) {
    throw MissingKey(
        fmt::format("there is no factor {}: the graph has {}", position, graph.factor_count()));
  }
  Factor factor = graph.factor(position);
  return {std::string(factor.type->tag()), std::move(factor.variables),
          std::move(factor.measurement), std::move(factor.type)};
}

void fix(BoundGraph& bound, const py::object& ids, bool fixed) {
  Graph& graph = bound.get();
  const Ids which = one_or_several(ids, "ids");
  std::vector<int> indices;
  for (const Id id : span_of(which)) indices.push_back(index_of(graph, id));
  for (const int index : indices) graph.set_fixed(index, fixed);
}

std::vector<Id> fixed_ids(BoundGraph& bound) {
  const Graph& graph = bound.get();
  std::vector<Id> ids;
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (graph.fixed(v)) ids.push_back(graph.id(v));
  }
  return ids;
}

/// Factors by position, variables by id with all factors on them.
void remove(BoundGraph& bound, const py::args& unnamed, const py::object& ids,
            const py::object& factors) {
  if (!unnamed.empty()) {
    throw py::type_error(
        "remove takes what leaves by name: remove(variables=ids), remove(factors=positions)");
  }
  Graph& graph = bound.get();
  std::vector<bool> factor_leaves(graph.factor_count()), variable_leaves(graph.variable_count());
  const Ids positions = one_or_several(factors, "factors"),
            variables = one_or_several(ids, "variables");
  for (const Id position : span_of(positions)) {
    if (position < 0 || position >= graph.factor_count())
      throw MissingKey(fmt::format("there is no factor {}", position));
    factor_leaves[static_cast<std::size_t>(position)] = true;
  }
  for (const Id id : span_of(variables)) variable_leaves[index_of(graph, id)] = true;
  for (int f = 0; f < graph.factor_count(); ++f) {
    for (const int v : graph.factor_variables(f)) {
      if (variable_leaves[v]) factor_leaves[f] = true;
    }
  }
  graph.remove(factor_leaves, variable_leaves);
}

template <class Pools, class Size>
std::map<std::string, std::size_t> counts(const Pools& pools, const Size& size) {
  std::map<std::string, std::size_t> result;
  for (const auto& pool : pools) {
    if (size(pool) > 0) result[std::string(pool.type->tag())] += size(pool);
  }
  return result;
}

std::map<std::string, std::size_t> variable_counts(BoundGraph& bound) {
  return counts(bound.get().variable_pools(),
                [](const VariablePool& pool) { return pool.variables.size(); });
}
std::map<std::string, std::size_t> factor_counts(BoundGraph& bound) {
  return counts(bound.get().factor_pools(), [](const FactorPool& pool) { return pool.size(); });
}

double chi2_of(BoundGraph& bound) {
  const GraphUse use(bound);
  const py::gil_scoped_release unlocked;
  return chi2(use.graph());
}

py::array_t<double> squared_norms_of(BoundGraph& bound) {
  const GraphUse use(bound);
  std::vector<double> norms;
  {
    const py::gil_scoped_release unlocked;
    norms = squared_norms(use.graph());
  }
  return array_of(norms);
}

std::unique_ptr<BoundGraph> copy(BoundGraph& bound) {
  auto result = std::make_unique<BoundGraph>(bound.get().clone());
  result->stamps = bound.stamps;
  result->row_ids = bound.row_ids;
  result->notes = bound.notes;
  if (bound.truth) result->truth = copy(*bound.truth);
  return result;
}

void set_stamps(BoundGraph& bound, std::vector<double> stamps) {
  const Graph& graph = bound.get();
  std::size_t poses = 0;
  for (const VariablePool& pool : graph.variable_pools()) {
    if (has_orientation(*pool.type)) poses += pool.variables.size();
  }
  const bool rising = std::ranges::is_sorted(stamps) &&
                      std::ranges::all_of(stamps, [](double s) { return std::isfinite(s); });
  if (stamps.size() != poses || !rising) {
    throw Error(ErrorCode::usage,
                fmt::format("stamps: expected {} finite numbers that do not fall, one for each "
                            "pose by rising id",
                            poses));
  }
  bound.stamps = std::move(stamps);
}

void bind_building(py::class_<BoundGraph>& graph) {
  graph.def(py::init<>())
      .def("add", &add_variable, py::arg("id"), py::arg("value"), py::arg("fixed") = false,
           py::arg("type") = py::none(),
           R"(Adds a variable with an initial estimate; returns its index.

value: a Pose2, Pose3, Point2 or Point3, or the numbers of a state of the variable type `type`, given by its tag.
fixed: held at this value by every optimisation.)")
      .def("add", &add_measurement, py::arg("measurement"), py::kw_only(),
           py::arg("sigmas") = py::none(), py::arg("information") = py::none(),
           py::arg("covariance") = py::none(), py::arg("loss") = py::none(),
           R"(Adds a measurement; returns its position among all factors.

How certain it is, in the order and the units of its error of n numbers, says one of
sigmas: n standard deviations, or one for all; infinity for what is not measured;
information: the n x n information matrix, positive semidefinite;
covariance: its inverse, positive definite.
loss: a robust loss of its own, such as "cauchy:scale=2".)")
      .def(
          "add", [](BoundGraph& bound, const Factor& factor) { return bound.get().add(factor); },
          py::arg("factor"), "Adds a measurement with its noise; returns its position.")
      .def(
          "add",
          [](BoundGraph&, const py::args& arguments, const py::kwargs& named) {
            refuse_added(arguments, named);
          },
          "Anything else is a TypeError.")
      .def("fix", &fix, py::arg("ids"), py::arg("fixed") = true,
           "Holds variables at their present estimates, or releases them: one id, or several.")
      .def("remove", &remove, py::arg("variables") = py::tuple(), py::arg("factors") = py::tuple(),
           "Takes out variables (ids, or one id) with all factors on them, and factors (positions, "
           "or one); those after them move up. By name: remove(variables=…).")
      .def(
          "set_loss",
          [](BoundGraph& bound, const py::object& loss, const std::string& on) {
            bound.get().set_loss(loss_of(loss), selector_of(on));
          },
          py::arg("loss"), py::arg("on") = "all",
          R"(Gives factors a robust loss, and takes it from all others.

loss: its name with options, such as "cauchy:scale=2"; None: no loss.
on: "all", "loops" (loop closures only) or the tag of a factor type.)");
}

void bind_contents(py::class_<BoundGraph>& graph) {
  graph
      .def("at", &value_at, py::arg("id"),
           "The estimate of a variable: a Pose2, Pose3, Point2 or Point3; of other types its "
           "numbers.")
      .def("__contains__",
           [](BoundGraph& bound, Id id) { return bound.get().find(id).has_value(); })
      .def_property_readonly("variable_count",
                             [](BoundGraph& bound) { return bound.get().variable_count(); })
      .def_property_readonly("factor_count",
                             [](BoundGraph& bound) { return bound.get().factor_count(); })
      .def_property_readonly("variable_types", &variable_counts,
                             "How many variables there are of each type, by tag.")
      .def_property_readonly("factor_types", &factor_counts,
                             "How many factors there are of each type, by tag.")
      .def_property_readonly("fixed", &fixed_ids, "Ids of the variables that are fixed.")
      .def("factor", &measured_at, py::arg("position"),
           "The measurement of one factor, by its position in the order of addition.")
      .def("chi2", &chi2_of,
           "The sum of rho(||r||^2) over all factors at the present estimate, without a half.")
      .def("squared_norms", &squared_norms_of,
           "||r||^2 of each factor by position, whitened and without its loss.")
      .def("copy", &copy, "A graph of its own with the same contents.")
      .def("__copy__", &copy)
      .def("__deepcopy__", [](BoundGraph& bound, const py::dict&) { return copy(bound); })
      .def_property(
          "stamps", [](const BoundGraph& bound) { return array_of(bound.stamps); }, &set_stamps,
          "Time [s] of each pose by rising id, where the file that it was read from has them, or "
          "as they were set.")
      .def_property_readonly(
          "notes", [](const BoundGraph& bound) { return bound.notes; },
          "What reading the file skipped or changed, a sentence each.")
      .def_property_readonly(
          "truth", [](const BoundGraph& bound) { return bound.truth.get(); },
          py::return_value_policy::reference_internal,
          "The graph at the true states, where the file that it was read from has them (format "
          "pyfg); else None.")
      .def("__repr__", [](BoundGraph& bound) {
        const std::string text = to_string(bound.get(), 0);
        return "<cairn.Graph: " + text.substr(0, text.find('\n')) + ">";
      });
}

}  // namespace

void bind_graph(py::module_& module) {
  py::class_<BoundGraph> graph(module, "Graph", kDoc);
  bind_building(graph);
  bind_contents(graph);
  bind_graph_arrays(graph);
  bind_pickles(graph);
}

}  // namespace cairn::python
