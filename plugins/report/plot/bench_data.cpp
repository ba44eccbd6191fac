// SPDX-License-Identifier: BSD-3-Clause
#include "bench_data.hpp"

#include <boost/json/parse.hpp>

#include "cairn/runtime/error.hpp"
#include "json_members.hpp"

namespace cairn::plot {
namespace {

namespace json = boost::json;

BenchConfiguration read_configuration(const json::value& value) {
  BenchConfiguration c;
  c.name = text(value, "label");
  if (c.name.empty()) {  // reports of earlier versions
    c.name = text(value, "optimizer");
    const std::string solver = text(value, "linear_solver");
    if (!solver.empty() && solver != "-") c.name += ", " + solver;
  }
  if (const json::value* seconds = member(value, "seconds")) {
    c.median = number(*seconds, "median");
    c.low = number(*seconds, "min");
    c.high = number(*seconds, "max");
    c.ran = c.median > 0;
  }
  c.memory = number(value, "peak_memory_bytes");
  if (const json::value* chi2 = member(value, "chi2")) c.initial_chi2 = number(*chi2, "initial");
  for (const json::value& iteration : list(value, "history")) {
    c.chi2.push_back(number(iteration, "chi2"));
    c.seconds.push_back(number(iteration, "seconds"));
  }
  return c;
}

}  // namespace

std::vector<BenchGraph> read_bench(std::string_view bench) {
  if (bench.empty()) {
    throw Error(
        ErrorCode::input,
        "no comparison to draw: give the JSON that cairn bench --json writes; of a CSV file "
        "columns are drawn");
  }
  json::parse_options options;
  options.allow_invalid_utf8 = true;
  json::error_code error;
  const json::value report = json::parse(bench, error, {}, options);
  if (error) {
    throw Error(ErrorCode::input, "the comparison is not JSON: " + error.message());
  }
  std::vector<BenchGraph> graphs;
  for (const json::value& value : list(report, "graphs")) {
    BenchGraph graph;
    if (const json::value* about = member(value, "graph")) {
      graph.name = text(*about, "name");
      if (graph.name.empty()) graph.name = text(*about, "file");
      graph.variables = number(*about, "variables");
    }
    for (const json::value& c : list(value, "configurations")) {
      graph.configurations.push_back(read_configuration(c));
    }
    graphs.push_back(std::move(graph));
  }
  if (graphs.empty()) throw Error(ErrorCode::input, "the comparison has no graphs");
  return graphs;
}

}  // namespace cairn::plot
