// SPDX-License-Identifier: BSD-3-Clause
// cairn.FactorType: factors written in Python.
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "cairn/evaluation/check_factor.hpp"
#include "cairn/evaluation/check_wrapping.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "component_names.hpp"
#include "measured.hpp"
#include "python_factor.hpp"

namespace cairn::python {
namespace {

const char* const kDoc =
    R"(A kind of factor whose residual is a function of arrays, for many factors at once.

    def residual(pose, beacon, measured):  # (n, 3), (n, 2), (n, 1)
        return np.hypot(*(beacon - pose[:, :2]).T)[:, None] - measured

    distance = cairn.FactorType("EDGE_DISTANCE", [cairn.Pose2, cairn.Point2], residual, residual_size=1, measurement_size=1)
    graph.add_factors(distance, ids, distances, sigmas=0.1)

tag: its name in files and messages, which no plugin's factor type has.
variables: the types of its variables, by class or tag.
residual: called with the states of each variable, an array (n, m) of the numbers that a graph stores, and with what was
    measured, (n, measurement_size); returns the errors, (n, residual_size), prediction minus measurement, not whitened.
jacobians: called likewise; returns for each variable an array (n, residual_size, d), the derivative of the error by the
    step delta with x_true = x.retract(delta). None: central differences, two calls for each number of delta.

Both must depend on their arguments alone. An exception in them becomes an Error.)";

/// A tag of a plugin: with two types of it, neither could be asked for by its tag any more.
void refuse_tag_of_plugin(std::string_view tag) {
  for (const Offer& offer : default_registry().offers()) {
    if (offer.kind != "factor" || offer.name != tag || offer.file.empty()) continue;
    throw Error(ErrorCode::usage,
                fmt::format("FactorType: '{}' is a factor type of the plugin '{}' already: give "
                            "yours a tag of its own, such as 'MY_{}'",
                            tag, offer.plugin, tag));
  }
}

std::shared_ptr<PythonFactor> make(std::string tag, const py::iterable& variables,
                                   py::object residual, int residual_size, int measurement_size,
                                   py::object jacobians) {
  refuse_tag_of_plugin(tag);
  BatchedFactorType::Description description{std::move(tag), {}, residual_size, measurement_size};
  for (const py::handle type : variables) {
    description.variables.push_back(
        default_registry().variable_type(tag_of(py::reinterpret_borrow<py::object>(type))));
  }
  if (PyCallable_Check(residual.ptr()) == 0 ||
      (!jacobians.is_none() && PyCallable_Check(jacobians.ptr()) == 0)) {
    throw Error(ErrorCode::usage, "residual and jacobians are functions");
  }
  return std::make_shared<PythonFactor>(std::move(description), std::move(residual),
                                        std::move(jacobians));
}

/// Throws `Error` (plugin) where an error is an angle that is not wrapped.
double largest_deviation(const PythonFactor& factor, const py::sequence& states,
                         const py::object& measurement) {
  if (py::len(states) != static_cast<std::size_t>(factor.arity())) {
    throw Error(ErrorCode::usage, fmt::format("states: {} has {} variables, not {}", factor.tag(),
                                              factor.arity(), py::len(states)));
  }
  std::vector<Doubles> arrays;
  std::vector<const double*> x;
  std::vector<const VariableType*> types;
  for (int k = 0; k < factor.arity(); ++k) {
    arrays.push_back(doubles_of(states[k], fmt::format("states[{}]", k)));
    if (arrays.back().size() != factor.ambient_size(k)) {
      throw Error(ErrorCode::usage, fmt::format("states[{}]: {} numbers, expected {}", k,
                                                arrays.back().size(), factor.ambient_size(k)));
    }
    x.push_back(arrays.back().data());
    types.push_back(factor.variables()[static_cast<std::size_t>(k)].get());
  }
  const Doubles measured = doubles_of(measurement, "measurement");
  if (measured.size() != factor.measurement_size()) {
    throw Error(ErrorCode::usage, fmt::format("measurement: {} numbers, expected {}",
                                              measured.size(), factor.measurement_size()));
  }
  if (const auto angle = find_unwrapped_angle(factor, types, x, span_of(measured))) {
    throw Error(
        ErrorCode::plugin,
        fmt::format("factor '{}': an error that is an angle is not wrapped to [-pi, pi): {}; "
                    "(error + numpy.pi) % (2 * numpy.pi) - numpy.pi is",
                    factor.tag(), to_text(*angle)));
  }
  return check_factor(factor, types, x, span_of(measured)).largest_deviation;
}

}  // namespace

void bind_factor_types(py::module_& module) {
  py::class_<PythonFactor, std::shared_ptr<PythonFactor>>(module, "FactorType", kDoc)
      .def(py::init(&make), py::arg("tag"), py::arg("variables"), py::arg("residual"),
           py::kw_only(), py::arg("residual_size"), py::arg("measurement_size"),
           py::arg("jacobians") = py::none())
      .def_property_readonly(
          "tag", [](const PythonFactor& factor) { return std::string(factor.tag()); },
          "Its name in files and messages.")
      .def(
          "check", &largest_deviation, py::arg("states"), py::arg("measurement"),
          R"(How far the Jacobians are from differences of the residual, relative to their largest entry, at least to 1.

Right ones deviate by some 1e-9 (central differences by 1e-8), wrong ones by 1e-2 or more.
states: a state for each variable. measurement: measurement_size numbers.

Raises Error where an error jumps by a full turn elsewhere than at ±pi, as an angle does that is not wrapped: while each
variable moves, from these states and from others around them, also with other measurements. Where residual raises there,
it is left out; Ctrl-C ends the check with KeyboardInterrupt. Calls residual some 2000 times for each degree of
freedom.)")
      .def("__repr__", [](const PythonFactor& factor) {
        return fmt::format("<cairn.FactorType {}>", factor.tag());
      });
  module.def(
      "register",
      [](const std::shared_ptr<PythonFactor>& factor, const std::string& summary) {
        refuse_tag_of_plugin(factor->tag());  // whose plugin may have been found since
        default_registry().add(std::shared_ptr<const FactorType>(factor), summary);
      },
      py::arg("factor_type"), py::arg("summary") = "",
      "Makes a factor type known by its tag, also for reading files that have it; once per tag.");
}

}  // namespace cairn::python
