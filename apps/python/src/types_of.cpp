// SPDX-License-Identifier: BSD-3-Clause
#include "types_of.hpp"

#include "arrays.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/typed/build.hpp"
#include "component_names.hpp"
#include "python_factor.hpp"

namespace cairn::python {
namespace {

/// Puts the state into `value` as a `T` if the tag is that of one.
template <class T>
bool is_a(std::string_view tag, std::span<const double> state, py::object& value) {
  if (tag != T::Traits::kTag) return false;
  value = py::cast(T::from_state(state));
  return true;
}

}  // namespace

std::shared_ptr<const VariableType> variable_type_of(const Graph& graph, std::string_view tag) {
  auto type = cairn::detail::type_in(graph.variable_pools(), tag);
  return type ? type : default_registry().variable_type(tag);
}

std::shared_ptr<const FactorType> factor_type_of(const Graph& graph, std::string_view tag) {
  auto type = cairn::detail::type_in(graph.factor_pools(), tag);
  return type ? type : default_registry().factor_type(tag);
}

std::shared_ptr<const FactorType> factor_type_of(const Graph& graph, const py::object& type) {
  if (std::shared_ptr<const FactorType> own = python_factor(type)) return own;
  return factor_type_of(graph, std::string_view(tag_of(type)));
}

py::object value_of(const VariableType& type, std::span<const double> state) {
  py::object value;
  const std::string_view tag = type.tag();
  if (is_a<Pose2>(tag, state, value) || is_a<Pose3>(tag, state, value) ||
      is_a<Point2>(tag, state, value) || is_a<Point3>(tag, state, value))
    return value;
  return array_of(state);
}

}  // namespace cairn::python
