// SPDX-License-Identifier: BSD-3-Clause
// cairn bench GRAPH…: solvers side by side on the same graphs.
#include <algorithm>
#include <memory>

#include <fmt/core.h>
#include <boost/json/object.hpp>

#include "bench_report.hpp"
#include "bench_run.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/album.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/json_text.hpp"
#include "cairn/program/latex_table.hpp"
#include "cairn/program/picture_files.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::app {
namespace {

void check(const BenchOptions& options, Session& session) {
  check_file(options.csv, session);
  check_file(options.latex, session);
  if (options.html.empty()) return;
  check_makes_pages("leave out --html", session);
  check_file(options.html, session);
}

/// A configuration that could not run at all is an error of the command, but not one that keeps the
/// others from being reported.
int exit_code(const BenchResult& bench) {
  if (bench.interrupted) return kExitInterrupted;
  bool failed = false;
  for (const GraphResult& graph : bench.graphs) {
    for (const ConfigurationResult& result : graph.results) {
      if (result.plugin_fault) return static_cast<int>(ErrorCode::plugin);
      failed = failed || !result.error.empty();
    }
  }
  return failed ? static_cast<int>(ErrorCode::numerical) : 0;
}

/// The graph with its first estimate and that of each configuration.
Scene scene_of_result(const GraphResult& result) {
  Graph graph = result.loaded.graph.clone();
  Scene scene = scene_of(graph, result.loaded.label);
  const std::vector<std::string> labels = configuration_labels(result.results);
  scene.estimates.push_back(place(graph, scene, "initial estimate", EstimateRole::initial));
  for (std::size_t k = 0; k < labels.size(); ++k) {
    const ConfigurationResult& configuration = result.results[k];
    if (configuration.runs.empty()) continue;
    const bool first = scene.runs.empty();
    graph.set_values(configuration.states);
    scene.estimates.push_back(
        place(graph, scene, labels[k], first ? EstimateRole::estimate : EstimateRole::peer));
    // All of them end at nearly the same residuals; once is enough.
    if (!first) scene.estimates.back().edge_chi2.clear();
    scene.estimates.back().run = static_cast<int>(scene.runs.size());
    scene.runs.push_back(
        {labels[k], median_run(configuration), threads(), configuration.peak_memory});
  }
  return scene;
}

void write_page(const BenchOptions& options, const std::vector<GraphResult>& graphs,
                const boost::json::object& report, Session& session) {
  Album album = begin_album("Solvers side by side", "");
  album.command = "cairn bench";
  for (const std::string& graph : options.graphs) album.command += " " + graph;
  album.bench = json_text(report);
  for (const GraphResult& graph : graphs) {
    try {
      album.scenes.push_back(scene_of_result(graph));
    } catch (const Error& error) {  // nothing to draw, but all to compare
      album.notes.emplace_back(error.what());
    }
  }
  write_picture(album, {"html", {}}, options.html, session);
}

void print_tables(const BenchOptions& options, const BenchResult& bench, const Session& session) {
  for (const GraphResult& graph : bench.graphs) {
    session.print((&graph == &bench.graphs.front() ? "" : "\n") +
                  bench_text(graph, options.problem.stop, session.colour()));
  }
  if (!options.html.empty()) session.print(fmt::format("\npage: {}\n", options.html));
}

/// A table for each graph, below its name as a comment.
void write_latex(const BenchOptions& options, const BenchResult& bench) {
  std::string text;
  for (const GraphResult& graph : bench.graphs)
    text += fmt::format("% {}\n{}\n", printable(graph.loaded.label),
                        bench_table(graph, options.problem.stop).latex());
  write_file(options.latex, text);
}

/// What speaks against the best estimate of each graph.
void note_doubts(const BenchResult& bench, const Session& session) {
  for (const GraphResult& graph : bench.graphs) {
    const ConfigurationResult* best = nullptr;
    for (const ConfigurationResult& result : graph.results) {
      if (result.runs.empty()) continue;
      if (!best || result.runs.front().final_chi2 < best->runs.front().final_chi2) best = &result;
    }
    if (!best) continue;
    for (const std::string& doubt : best->doubts)
      session.note(fmt::format("{}: {}", graph.loaded.label, doubt));
  }
}

int run(const BenchOptions& options, Session& session) {
  check(options, session);
  session.use_threads();
  const BenchResult bench = run_bench(options, session);
  const boost::json::object report = bench_json(options, bench);
  Results results;
  results.write(options.csv, [&] { write_file(options.csv, bench_csv(bench.graphs)); });
  results.write(options.latex, [&] { write_latex(options, bench); });
  results.write(options.html, [&] { write_page(options, bench.graphs, report, session); });
  results.add([&] { session.write_json(report); });
  results.add([&] { print_tables(options, bench, session); });
  results.finish();
  note_doubts(bench, session);
  if (const auto slow = session.registry().unoptimized(); !slow.empty()) {
    session.note(
        fmt::format("unoptimised build, times mean little: plugin {}", joined(slow, ", ")));
  }
  return exit_code(bench);
}

}  // namespace

void add_bench(Registrar& registrar) {
  add_command<BenchOptions>(
      registrar, "bench",
      "Every run starts from the same initial estimate and ends as optimize does; for N equal "
      "steps, "
      "add\n"
      "--tolerance 0. Times are of optimisation alone. 'ratio' is the median over rounds of the "
      "time\n"
      "against the first line's in the same round. 'memory' is that of a process of its own that "
      "reads\n"
      "and optimises once, as cairn optimize.\n\n"
      "Example:\n"
      "  cairn bench sphere.g2o @manhattan:poses=3500 --optimizer levenberg_marquardt,ceres --csv "
      "runs.csv",
      run);
}

}  // namespace cairn::app
