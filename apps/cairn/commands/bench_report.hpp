// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <boost/json/fwd.hpp>

#include "bench_run.hpp"
#include "cairn/program/table.hpp"

namespace cairn::app {

/// One line per configuration: medians, ratios, agreement.
Table bench_table(const GraphResult& graph, const Stop& stop);
/// The same as text, below a line on the graph, and what failed.
std::string bench_text(const GraphResult& graph, const Stop& stop, bool colour);
/// One object per graph, one per configuration, and in it every run.
boost::json::object bench_json(const BenchOptions& options, const BenchResult& result);
/// One line per run, with a title line.
std::string bench_csv(const std::vector<GraphResult>& graphs);

}  // namespace cairn::app
