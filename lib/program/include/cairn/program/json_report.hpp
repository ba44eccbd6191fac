// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <boost/json/array.hpp>
#include <boost/json/object.hpp>

#include "cairn/graph/graph.hpp"

namespace cairn::app {

/// {"cairn": version, "command": …}, how every report begins.
boost::json::object begin_report(std::string_view command);
/// Adds "peak_memory_bytes", "machine" and "build", how reports with times end.
void end_report(boost::json::object& report);

/// {"file", "name", "variables", "factors", "residual_size", "tangent_size", "metric"}; `name` is
/// what tables and pictures call the graph (empty: its `graph_label`); the metric (`metric_of`) is
/// null where no factor has a choice.
boost::json::object graph_json(const Graph& graph, const std::string& file,
                               const std::string& name = "");
/// The text, or null where there is none.
boost::json::value text_json(const std::string& text);
/// The number, or null where it is not finite.
boost::json::value number_json(double number);
boost::json::array strings_json(const std::vector<std::string>& strings);

/// The processor's name, from /proc/cpuinfo; "unknown" where that is silent.
std::string cpu_name();

}  // namespace cairn::app
