// SPDX-License-Identifier: BSD-3-Clause
#include "bench_report.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "cairn/program/error_metric.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

constexpr std::size_t kColumns = 12;  // of the table

double seconds_per_iteration(const ConfigurationResult& result) {
  std::vector<double> all;
  for (const Summary& run : result.runs) {
    if (!run.iterations.empty()) {
      all.push_back(run.seconds.total / static_cast<double>(run.iterations.size()));
    }
  }
  return median(all);
}

std::string number_or_dash(fmt::string_view format, double number) {
  return std::isfinite(number) ? fmt::format(fmt::runtime(format), number) : "-";
}

std::string spread_text(const std::vector<double>& seconds) {
  const auto [low, high] = std::minmax_element(seconds.begin(), seconds.end());
  return fmt::format("{} … {}", seconds_text(*low), seconds_text(*high));
}

std::string agreement_text(const ConfigurationResult& result, const GraphResult& graph) {
  const double excess = chi2_excess(result, graph);
  const std::string text = excess == 0.0 ? "0" : number_or_dash("{:+.1e}", excess);
  return chi2_agrees(result, graph) ? text : text + " !";
}

/// What a linear solver is called: as it was written, or what the optimizer says that it used.
std::string linear_solver_name(const ConfigurationResult& result) {
  if (!result.configuration.linear_solver.empty()) return result.configuration.linear_solver;
  if (!result.runs.empty() && !result.runs.front().linear_solver.empty()) {
    return result.runs.front().linear_solver;
  }
  return "-";
}

/// How the runs ended.
std::string status_text(const ConfigurationResult& result, const Stop& stop) {
  const bool late = std::ranges::any_of(
      result.runs, [&](const Summary& run) { return ran_out_of_time(run, stop); });
  return late ? "time limit" : std::string(to_string(result.runs.front().status));
}

std::vector<std::string> row(const ConfigurationResult& result, const GraphResult& graph,
                             const Stop& stop) {
  const std::string& optimizer = result.configuration.optimizer;
  if (result.runs.empty()) {
    std::vector<std::string> cells(kColumns);
    cells.front() = optimizer;
    cells[1] = linear_solver_name(result);
    cells.back() = result.error.empty() ? "not run" : "failed";
    return cells;
  }
  const Summary& first = result.runs.front();
  const std::vector<double> seconds = totals(result);
  const std::int64_t nonzeros = first.solver.factor_nonzeros;
  return {optimizer,
          linear_solver_name(result),
          seconds_text(median(seconds)),
          spread_text(seconds),
          number_or_dash("{:.2f}", paired_ratio(result, graph)),
          number_or_dash("{:.3g}", 1e3 * seconds_per_iteration(result)),
          fmt::format("{}", first.iterations.size()),
          chi2_text(first.final_chi2),
          agreement_text(result, graph),
          nonzeros > 0 ? count_text(nonzeros) : "-",
          bytes_text(result.peak_memory),
          status_text(result, stop)};
}

/// The optimizer that all rows have, or nothing.
std::string common_optimizer(const GraphResult& graph) {
  const std::string& first = graph.results.front().configuration.optimizer;
  const bool same = std::ranges::all_of(graph.results, [&](const ConfigurationResult& result) {
    return result.configuration.optimizer == first;
  });
  return same ? first : std::string();
}

json::array runs_json(const ConfigurationResult& result, const Stop& stop) {
  json::array all;
  for (const Summary& run : result.runs) {
    all.push_back({{"status", to_string(run.status)},
                   {"out_of_time", ran_out_of_time(run, stop)},
                   {"chi2", {{"initial", run.initial_chi2}, {"final", run.final_chi2}}},
                   {"iterations", run.iterations.size()},
                   {"seconds", to_json(run.seconds)}});
  }
  return all;
}

json::object times_json(const ConfigurationResult& result) {
  const std::vector<double> seconds = totals(result);
  return {{"median", median(seconds)},
          {"min", *std::min_element(seconds.begin(), seconds.end())},
          {"max", *std::max_element(seconds.begin(), seconds.end())},
          {"per_iteration", seconds_per_iteration(result)}};
}

json::object configuration_json(const ConfigurationResult& result, const GraphResult& graph,
                                const std::string& label, const Stop& stop) {
  json::object all{{"label", label},
                   {"optimizer", result.configuration.optimizer},
                   {"linear_solver", linear_solver_name(result)},
                   {"error", text_json(result.error)}};
  if (!result.runs.empty()) {
    const Summary& first = result.runs.front();
    all["status"] = to_string(first.status);
    all["chi2"] = {{"initial", first.initial_chi2},
                   {"final", first.final_chi2},
                   {"relative_difference", chi2_excess(result, graph)},
                   {"agrees", chi2_agrees(result, graph)}};
    all["iterations"] = first.iterations.size();
    all["seconds"] = times_json(result);
    all["ratio"] = paired_ratio(result, graph);
    all["solver"] = to_json(first.solver);
    std::vector<std::string> notes = first.notes;
    notes.insert(notes.end(), result.doubts.begin(), result.doubts.end());
    all["notes"] = strings_json(notes);
    std::vector<std::string> doubts = first.doubts;
    doubts.insert(doubts.end(), result.doubts.begin(), result.doubts.end());
    all["doubts"] = strings_json(doubts);
  }
  all["peak_memory_bytes"] =
      result.peak_memory > 0 ? json::value(result.peak_memory) : json::value(nullptr);
  all["runs"] = runs_json(result, stop);
  if (!result.runs.empty()) all["history"] = to_json(median_run(result).iterations);
  return all;
}

/// A run in the table of `--csv`.
struct RunRow {
  const GraphResult& graph;
  const ConfigurationResult& result;
  std::size_t round;

  const Summary& run() const { return result.runs[round]; }
  static ResultFields<RunRow> fields() {
    using R = RunRow;
    return ResultFields<R>()
        .figure(
            "graph", [](const R& r) { return r.graph.loaded.label; }, "its name")
        .figure(
            "optimizer", [](const R& r) { return r.result.configuration.optimizer; },
            "as it was written")
        .figure(
            "linear_solver", [](const R& r) { return linear_solver_name(r.result); },
            "as it was written, or what the optimizer took")
        .figure(
            "status", [](const R& r) { return r.run().status; }, "how it ended")
        .figure(
            "cpu", [](const R&) { return cpu_name(); }, "the processor")
        .figure(
            "threads", [](const R&) { return threads(); }, "threads")
        .figure(
            "round", [](const R& r) { return r.round + 1; }, "from 1")
        .figure(
            "iterations", [](const R& r) { return r.run().iterations.size(); }, "iterations")
        .figure(
            "factor_nonzeros", [](const R& r) { return r.run().solver.factor_nonzeros; },
            "numbers in the factor of H; 0: not known")
        .figure(
            "peak_memory_bytes", [](const R& r) { return r.result.peak_memory; }, "bytes",
            "of the configuration; 0: not measured")
        .figure(
            "chi2.initial", [](const R& r) { return r.run().initial_chi2; },
            "of the initial estimate")
        .figure(
            "chi2.final", [](const R& r) { return r.run().final_chi2; }, "at the end")
        .part("seconds", [](const R& r) { return r.run().seconds; });
  }
};

}  // namespace

Table bench_table(const GraphResult& graph, const Stop& stop) {
  using Align = Table::Align;
  std::vector<Table::Column> columns{
      {"optimizer", Align::left},     {"linear solver", Align::left}, {"median", Align::right},
      {"min … max", Align::right, 4}, {"ratio", Align::right},        {"ms/it", Align::right, 2},
      {"it", Align::right},           {"chi2", Align::right},         {"above best", Align::right},
      {"nnz(L)", Align::right, 3},    {"memory", Align::right, 1},    {"status", Align::left}};
  const std::string optimizer = common_optimizer(graph);
  const int leading = optimizer.empty() ? 0 : 1;  // columns that say the same in every row
  columns.erase(columns.begin(), columns.begin() + leading);
  Table table(std::move(columns));
  for (const ConfigurationResult& result : graph.results) {
    std::vector<std::string> cells = row(result, graph, stop);
    cells.erase(cells.begin(), cells.begin() + leading);
    table.add(std::move(cells));
  }
  return table;
}

std::string bench_text(const GraphResult& graph, const Stop& stop, bool colour) {
  const std::string optimizer = common_optimizer(graph), metric = metric_of(graph.loaded.graph);
  std::string text =
      fmt::format("{}: {}, {}{}{}\n{}", bold(graph.loaded.label, colour),
                  plural(graph.loaded.graph.variable_count(), "variable"),
                  plural(graph.loaded.graph.factor_count(), "factor"),
                  metric.empty() ? "" : ", metric " + metric,
                  optimizer.empty() ? "" : "; " + optimizer, bench_table(graph, stop).text(colour));
  for (const ConfigurationResult& result : graph.results) {
    if (!result.error.empty()) {
      text += fmt::format("failed: {} {}: {}\n", result.configuration.optimizer,
                          result.configuration.linear_solver, result.error);
    }
  }
  return text;
}

json::object bench_json(const BenchOptions& options, const BenchResult& result) {
  const Stop& stop = options.problem.stop;
  json::object report = begin_report("bench");
  report["threads"] = threads();
  report["repeat"] = options.repeat;
  report["initial"] = options.problem.initial;
  report["loss"] = text_json(options.problem.loss);
  report["max_iterations"] = stop.max_iterations;
  report["tolerance"] = stop.tolerance;
  report["max_seconds"] = stop.max_seconds;
  report["left_out"] = strings_json(result.left_out);
  report["interrupted"] = result.interrupted;
  json::array& all = report["graphs"].emplace_array();
  for (const GraphResult& graph : result.graphs) {
    const std::vector<std::string> labels = configuration_labels(graph.results);
    json::array rows;
    for (std::size_t k = 0; k < labels.size(); ++k)
      rows.push_back(configuration_json(graph.results[k], graph, labels[k], stop));
    all.push_back({{"graph", graph_json(graph.loaded.graph, graph.loaded.name, graph.loaded.label)},
                   {"configurations", std::move(rows)}});
  }
  end_report(report);
  return report;
}

std::string bench_csv(const std::vector<GraphResult>& graphs) {
  CsvText csv(result_fields<RunRow>().all(), CsvText::Numbers::whole, "\r\n");
  for (const GraphResult& graph : graphs) {
    for (const ConfigurationResult& result : graph.results) {
      for (std::size_t k = 0; k < result.runs.size(); ++k)
        csv.add(result_record(RunRow{graph, result, k}));
    }
  }
  return csv.text();
}

}  // namespace cairn::app
