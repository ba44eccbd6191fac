// SPDX-License-Identifier: BSD-3-Clause
// cairn sparsify GRAPH --edges NAME: takes loop closures out of a graph; all poses stay.
#include "sparsify_edges.hpp"

#include <chrono>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <boost/json/object.hpp>

#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/error_metric.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/sparsification/sparsify_edges.hpp"
#include "information_frame.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

/// Options that are about nodes that leave.
void check_options(const SparsifyCommandOptions& options) {
  const SparsifyCommandOptions none;
  const std::pair<const char*, bool> given[] = {
      {"--keep-every", options.keep_every != none.keep_every},
      {"--select", options.select != none.select},
      {"--nodes", options.nodes != none.nodes},
      {"--topology", options.topology != none.topology},
      {"--population", options.population != none.population},
      {"--recovery", options.recovery != none.recovery},
      {"--scheme", options.scheme != none.scheme},
      {"--sparsifier", options.sparsifier != none.sparsifier},
      {"--online", options.online != none.online},
      {"--redirect", options.redirect != none.redirect},
      {"--redirect-to", options.redirect_to != none.redirect_to},
      {"--newer", options.newer != none.newer},
      {"--inflation", options.inflation != none.inflation},
      {"--record", options.record != none.record}};
  for (const auto& [name, is_given] : given) {
    if (!is_given) continue;
    throw Error(ErrorCode::usage,
                fmt::format("--edges removes loop closures and no node, {} is about removed nodes: "
                            "give one of the two",
                            name));
  }
}

SparsifyEdgesJob job_of(const SparsifyCommandOptions& options, Session& session) {
  return {.selection = parse_component(options.edges),
          .optimizer = optimizer_spec(options.optimizer, "", session.registry()),
          .linear_solver = options.linear_solver,
          .as_given = options.as_given,
          .measure = !options.no_kld,
          .compared_at = options.compared_at == "minima" ? ComparedAt::minima : ComparedAt::common};
}

json::object report_json(const SparsifyCommandOptions& options, const LoadedGraph& loaded,
                         const SparsifyEdgesJob& job, const SparsifyEdgesResult& result) {
  json::object report = begin_report("sparsify");
  report["graph"] = graph_json(loaded.graph, loaded.name);
  report["edges"] = to_text(job.selection);
  report["threads"] = threads();
  put(report, result);
  report["output"] = text_json(options.output);
  end_report(report);
  return report;
}

std::string connectivity_text(const SparsifyEdgesResult& result) {
  std::string text;
  for (const EdgeWeight weight : {EdgeWeight::rotation, EdgeWeight::translation}) {
    const Connectivity& of = result.connectivity[static_cast<std::size_t>(weight)];
    if (!std::isfinite(of.full)) continue;
    if (!text.empty()) text += "; ";
    text += fmt::format("{} {:.4g} of {:.4g}", to_string(weight), of.sparse, of.full);
    if (std::isfinite(of.bound)) {
      text += fmt::format(" (no choice of as many has more than {:.4g}, {:.3g} times as much)",
                          of.bound, of.bound / of.sparse);
    }
  }
  return text;
}

std::string summary_text(const SparsifyCommandOptions& options, const LoadedGraph& loaded,
                         const SparsifyEdgesJob& job, const SparsifyEdgesResult& result,
                         const Results& results, const Session& session) {
  const SparsifyResult& whole = result.whole;
  const Figures figures(result);
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  table.add(
      {"graph", fmt::format("{}: {}, {}", loaded.name, plural(whole.variables_before, "variable"),
                            plural(whole.factors_before, "factor"))});
  add_metric(table, loaded.graph, session);
  const auto loops = std::ssize(result.closures.candidates);
  table.add({"removed", fmt::format("{} of {} ({})", std::ssize(whole.change.removed_factors),
                                    plural(loops, "loop closure"), to_text(job.selection))});
  table.add({"left", fmt::format("{}, {}", plural(whole.sparse.variable_count(), "variable"),
                                 plural(whole.sparse.factor_count(), "factor"))});
  if (whole.error) {
    std::string text = fmt::format("KLD {} of the whole", figures["kld"]);
    if (result.choice.kld_bound) {
      text += fmt::format(", {} of them of covariances (no choice of as many has less than {})",
                          figures.number("kld_parts.covariance"), figures.number("kld_bound"));
    }
    text += moved_text(whole);
    table.add({"lost", text});
  }
  if (const std::string text = connectivity_text(result); !text.empty())
    table.add({"algebraic connectivity", text});
  table.add({"time", fmt::format("select {}", figures["seconds.select"])});
  figures.add_rows(table);
  if (figures["status"] != "converged") table.add({"status", figures["status"]});
  for (const std::string& file : results.written({options.output})) table.add({"output", file});
  return table.text(false);
}

;

}  // namespace

int run_sparsify_edges(const SparsifyCommandOptions& options, Session& session) {
  check_options(options);
  Registry& registry = session.registry();
  const SparsifyEdgesJob job = job_of(options, session);
  registry.make<EdgeSelection>(job.selection);  // a wrong name is refused before a graph is read
  const ProblemSetup setup(options.problem, registry);
  LoadedGraph loaded = load_graph(options.graph, options.input, session);
  if (options.information_frame == "first") information_of_first_frame(loaded.graph);
  const InterruptGuard guard;
  WorkProgress edges(session.common.quiet);
  GuessProgress guess(session.common.quiet, guard.flag());
  Stop stop = options.problem.stop;
  stop.interrupt = &guard.flag();
  OptimizationProgress iterations(session.common.quiet, stop.max_iterations);
  const SparsifySetting setting{
      .registry = registry,
      .stop = stop,
      .loss = setup.loss(),
      .loss_on = setup.loss_selector(),
      .initialise = [&](Graph& whole) { return setup.apply(whole, std::ref(guess)); },
      .optimisation = &iterations,
      .progress =
          [&](const SparsifyProgress& progress) {
            edges.show(progress.part(), progress.to_string());
          }};
  const SparsifyEdgesResult result = sparsify_edges(loaded.graph, job, setting);
  for (const std::string& note : result.whole.notes) session.note(note);
  Results results;
  results.write(options.output, [&] {
    write_graph(result.whole.sparse, options.output, registry,
                output_format(options.output, options.output_format));
  });
  options.figures.write(Figures(result), results);
  results.add([&] { session.write_json(report_json(options, loaded, job, result)); });
  results.add([&] { session.print(summary_text(options, loaded, job, result, results, session)); });
  results.finish();
  if (guard.interrupted()) return kExitInterrupted;
  return result.whole.converged ? 0 : static_cast<int>(ErrorCode::numerical);
}

}  // namespace cairn::app
