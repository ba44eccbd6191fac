// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include <pybind11/pybind11.h>

#include "cairn/graph/graph.hpp"

/// Types by tag, and states as the Python values that they stand for.
namespace cairn::python {

namespace py = pybind11;

/// The type of that tag: the graph's own if it has one (a graph takes all of its types from one
/// registry), else the registry's. Throws `Error` (plugin) with the tags on offer.
std::shared_ptr<const VariableType> variable_type_of(const Graph& graph, std::string_view tag);
std::shared_ptr<const FactorType> factor_type_of(const Graph& graph, std::string_view tag);

/// The same of a tag or of a `cairn.FactorType`, as it is.
std::shared_ptr<const FactorType> factor_type_of(const Graph& graph, const py::object& type);

/// A Pose2, Pose3, Point2 or Point3 where the type is stored as one; else an array of its numbers.
py::object value_of(const VariableType& type, std::span<const double> state);

}  // namespace cairn::python
