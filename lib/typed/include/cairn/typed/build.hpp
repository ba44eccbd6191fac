// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/graph/elements.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/graph/information.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/measurements.hpp"
#include "cairn/typed/symbol.hpp"

/// Graphs and updates built from values. A type is found by its tag: the graph's own if it has one
/// of that tag (a graph takes all of its types from one registry), else the registry's.
namespace cairn {
namespace detail {

template <class Pools>
auto type_in(const Pools& pools, std::string_view tag) -> decltype(pools.front().type) {
  for (const auto& pool : pools) {
    if (pool.type->tag() == tag) return pool.type;
  }
  return nullptr;
}

template <MeasurementValue M>
std::shared_ptr<const FactorType> factor_type_of(Registry& registry) {
  if constexpr (requires { M::own_type(); }) {
    if (!registry.has("factor", M::kTag)) return M::own_type();
  }
  return registry.factor_type(M::kTag);
}

template <StateValue T>
std::shared_ptr<const VariableType> variable_type_of(Registry& registry) {
  using Traits = typename T::Traits;
  if constexpr (requires { T::own_type(); }) {
    if (!registry.has("variable", Traits::kTag)) return T::own_type();
  }
  return registry.variable_type(Traits::kTag);
}

/// The index of a variable. Throws `Error` (usage) for an id that the graph does not have.
inline int index_of(const Graph& graph, Id id) {
  if (const auto index = graph.find(id)) return *index;
  throw Error(ErrorCode::usage, "there is no variable " + id_text(id) + " in the graph");
}

}  // namespace detail

/// A variable with an initial estimate, for `Graph::add`, a `GraphUpdate` or a `PosePolicy`.
template <StateValue T>
Variable make_variable(Id id, const T& value, Registry& registry = default_registry()) {
  return {detail::variable_type_of<T>(registry), id, detail::copied(value), false};
}

/// A variable without an estimate, for a `GraphUpdate`, whose measurements then say where it is.
template <StateValue T>
Variable make_variable(Id id, Registry& registry = default_registry()) {
  return {detail::variable_type_of<T>(registry), id, {}, false};
}

/// A factor, for `Graph::add`, a `GraphUpdate` or a `PosePolicy`. `loss`: null for the plain
/// square.
template <MeasurementValue M>
Factor make_factor(const M& measurement, const Information& information,
                   std::shared_ptr<const Loss> loss = nullptr,
                   Registry& registry = default_registry()) {
  return {detail::factor_type_of<M>(registry), measurement.variables(), measurement.numbers(),
          information.packed(), std::move(loss)};
}

/// Adds a variable with that initial estimate; returns its index. Throws `Error` (input) for an id
/// that is there already.
template <StateValue T>
int add(Graph& graph, Id id, const T& value, Registry& registry = default_registry()) {
  auto type = detail::type_in(graph.variable_pools(), T::Traits::kTag);
  if (!type) type = detail::variable_type_of<T>(registry);
  return graph.add(Variable{std::move(type), id, detail::copied(value), false});
}

/// Adds a measurement with its information and, unless null, a robust loss of its own; returns its
/// position among the factors. Throws `Error` (input or usage) if a variable is not there or is of
/// another type, or a size does not fit.
template <MeasurementValue M>
int add(Graph& graph, const M& measurement, const Information& information,
        std::shared_ptr<const Loss> loss = nullptr, Registry& registry = default_registry()) {
  auto type = detail::type_in(graph.factor_pools(), M::kTag);
  if (!type) type = detail::factor_type_of<M>(registry);
  return graph.add(Factor{std::move(type), measurement.variables(), measurement.numbers(),
                          information.packed(), std::move(loss)});
}

/// The present estimate of a variable. Throws `Error` (usage) for an id that the graph does not
/// have, or a variable of another type.
template <StateValue T>
T at(const Graph& graph, Id id) {
  const int variable = detail::index_of(graph, id);
  if (graph.type(variable).tag() != T::Traits::kTag) {
    throw Error(ErrorCode::usage, graph.describe_variable(variable) + " is not a " +
                                      std::string(T::Traits::kTag) + ", which a " + T::kName +
                                      " is read from");
  }
  return T::from_state(graph.state(variable));
}

template <class T>
int Graph::add(Id id, const T& value) {
  return cairn::add(*this, id, value);
}
template <class M>
int Graph::add(const M& measurement, const Information& information,
               std::shared_ptr<const Loss> loss) {
  return cairn::add(*this, measurement, information, std::move(loss));
}
template <class T>
T Graph::at(Id id) const {
  return cairn::at<T>(*this, id);
}

template <class T>
void GraphUpdate::add(Id id, const T& value) {
  variables.push_back(make_variable(id, value));
}
template <class T>
void GraphUpdate::add(Id id) {
  variables.push_back(make_variable<T>(id));
}
template <class M>
void GraphUpdate::add(const M& measurement, const Information& information,
                      std::shared_ptr<const Loss> loss) {
  factors.push_back(make_factor(measurement, information, std::move(loss)));
}

}  // namespace cairn
