// SPDX-License-Identifier: BSD-3-Clause
// cairn optimize GRAPH: one optimisation, its estimate and its report.
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/io/losses_not_written.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/covariances.hpp"
#include "cairn/program/error_metric.hpp"
#include "cairn/program/figure_files.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/report/recording.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

struct OptimizeOptions {
  std::string graph;
  std::string output;
  std::string output_format;
  InputOptions input;
  ProblemOptions problem;
  std::string optimizer = kDefaultOptimizer;
  std::string linear_solver;  ///< empty: not given
  std::string covariance = "none";
  std::string record;  ///< file for the recording, or empty
  FigureFiles figures;

  static auto fields() {
    using O = OptimizeOptions;
    return OptionFields<O>()
        .text("graph", &O::graph, kGraphHelp)
        .positional()
        .placeholder("GRAPH")
        .or_generated_by({"generator"})
        .required()
        .text("output", &O::output, "write the estimate (- is standard output)")
        .letter('o')
        .placeholder("OUT")
        .component("to", &O::output_format, {"format"}, "format of OUT, instead of by the ending")
        .placeholder("FORMAT")
        .component("optimizer", &O::optimizer, {"optimizer"},
                   "the optimizer, with options as NAME:key=value")
        .component("linear_solver", &O::linear_solver, {"linear_solver"},
                   "solves H x = g in each step [block_cholesky; schur where most variables are "
                   "points that cameras see]")
        .part(&O::problem)
        .part(&O::problem, ProblemOptions::limit_fields())
        .text("record", &O::record, "every iteration's positions, for cairn view")
        .placeholder("FILE")
        .choice("covariance", &O::covariance, {"blocks", "none"},
                "blocks of every variable, in the report, or none")
        .part(&O::figures)
        .part(&O::input);
  }
};

void check(const OptimizeOptions& options, Session& session) {
  check_output(options.output, options.output_format, session);
  if (options.record == "-") {
    throw Error(ErrorCode::usage, "--record writes to a file, not to standard output; name one");
  }
  check_file(options.record, session);
  options.figures.check(session);
}

/// What `--initial` did.
struct InitialEstimate {
  std::vector<std::string> notes;
  double seconds = 0.0;
};

InitialEstimate initialise(Graph& graph, const ProblemSetup& setup, const OptimizeOptions& options,
                           const InterruptGuard& guard, const Session& session) {
  if (graph.factor_count() == 0) {  // a trajectory: all guesses would be as good
    session.note(fmt::format("{} has no factors: nothing to optimise", options.graph));
    return {};
  }
  const auto begin = std::chrono::steady_clock::now();
  GuessProgress progress(session.common.quiet, guard.flag());
  InitialEstimate result{.notes = setup.apply(graph, std::ref(progress))};
  result.seconds = seconds_since(begin);
  for (const std::string& note : result.notes)
    session.note(fmt::format("initial guess {}: {}", options.problem.initial, note));
  return result;
}

json::object report_json(const OptimizeOptions& options, const LoadedGraph& loaded,
                         const InitialEstimate& initial, const Summary& summary,
                         const DiagonalCovariances& covariances) {
  json::object report = begin_report("optimize");
  report["graph"] = graph_json(loaded.graph, loaded.name, loaded.label);
  report["threads"] = threads();
  report["initial"] = options.problem.initial;
  report["initial_notes"] = strings_json(initial.notes);
  report["loss"] = text_json(options.problem.loss);
  report["seconds"] = {{"read", loaded.seconds}, {"initial", initial.seconds}};
  put(report, summary);
  report["covariance"] = to_json(covariances, loaded.graph);
  report["read_notes"] = strings_json(sentences(loaded.report));
  report["output"] = text_json(options.output);
  report["recording"] = text_json(options.record);
  end_report(report);
  return report;
}

std::string summary_text(const OptimizeOptions& options, const LoadedGraph& loaded,
                         const InitialEstimate& initial, const Summary& summary,
                         const DiagonalCovariances& covariances, const Results& results,
                         const Session& session) {
  const Figures figures(summary);
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  table.add({"graph", fmt::format("{}: {}, {}", loaded.label,
                                  plural(loaded.graph.variable_count(), "variable"),
                                  plural(loaded.graph.factor_count(), "factor"))});
  add_metric(table, loaded.graph, session);
  if (!initial.notes.empty()) table.add({"start", initial.notes.front()});
  table.add({"solver", summary.linear_solver.empty()
                           ? summary.optimizer
                           : fmt::format("{} with {}", summary.optimizer, summary.linear_solver)});
  table.add({"chi2", fmt::format("{} → {}", figures["chi2.initial"], figures["chi2.final"])});
  table.add({"status", fmt::format("{} after {}", figures["status"],
                                   plural(std::ssize(summary.iterations), "iteration"))});
  table.add({"time", figures.times("seconds")});
  if (summary.solver.iterations > 0) {
    table.add({"inner", fmt::format("{}, relative residual at most {}; {}",
                                    plural(summary.solver.iterations, "iteration"),
                                    figures["solver.relative_residual"], summary.solver.note)});
  }
  figures.add_rows(table);
  if (covariances.there) {
    table.add({"covariance",
               fmt::format("of {} by {} in {}", plural(loaded.graph.variable_count(), "variable"),
                           covariances.linear_solver, seconds_text(covariances.seconds()))});
  }
  add_notes(table, summary.notes, summary.doubts);
  for (const std::string& file : results.written({options.output})) table.add({"output", file});
  for (const std::string& file : results.written({options.record})) table.add({"recording", file});
  return table.text(false);
}

/// "optimizer 'dogleg' with linear solver 'eigen'"
std::string in_words(const ComponentSpec& optimizer) {
  const auto solver = optimizer.values.find(kLinearSolverOption);
  return fmt::format("optimizer '{}'{}", optimizer.name,
                     solver == optimizer.values.end()
                         ? ""
                         : fmt::format(" with linear solver '{}'", solver->second));
}

/// `recording`: made here if one is asked for, to be finished when the results are written.
Summary solve(Graph& graph, Optimizer& optimizer, const ProblemSetup& setup,
              const OptimizeOptions& options, const InterruptGuard& guard, const Session& session,
              std::optional<RecordingWriter>& recording) {
  Stop stop = options.problem.stop;
  stop.interrupt = &guard.flag();
  OptimizationProgress progress(session.common.quiet, stop.max_iterations);
  if (!options.record.empty())
    recording.emplace(options.record, options.optimizer, options.graph, &progress);
  Observer& observer = recording ? static_cast<Observer&>(*recording) : progress;
  Summary summary = optimizer.optimize(graph, stop, observer);
  GuessProgress of_guess(session.common.quiet, guard.flag());
  setup.look_again(graph, optimizer, options.optimizer, stop, observer, std::ref(of_guess),
                   summary);
  return summary;
}

int run(const OptimizeOptions& options, Session& session) {
  check(options, session);
  session.use_threads();
  // Everything that is named is made before the file is read: a wrong name is told at once.
  Registry& registry = session.registry();
  ComponentSpec spec = optimizer_spec(options.optimizer, options.linear_solver, registry);
  auto optimizer = registry.make<Optimizer>(spec);
  std::optional<CovarianceSolver> covariance_solver;
  if (options.covariance == "blocks") covariance_solver = covariance_solver_of(spec, registry);
  const ProblemSetup setup(options.problem, registry);

  LoadedGraph loaded = load_graph(options.graph, options.input, session);
  if (options.linear_solver.empty()) {
    const ComponentSpec suited =
        with_suited_linear_solver(parse_component(options.optimizer), loaded.graph, registry);
    spec = optimizer_spec(spec_text(suited), "", registry);
    optimizer = registry.make<Optimizer>(spec);
  }
  const InterruptGuard guard;  // until the results are written
  const InitialEstimate initial = initialise(loaded.graph, setup, options, guard, session);
  std::optional<RecordingWriter> recording;
  Summary summary = call_plugin(
      [&] { return in_words(spec); },
      [&] { return solve(loaded.graph, *optimizer, setup, options, guard, session, recording); });
  Results results;
  results.write(options.output, [&] {
    const std::string format = output_format(options.output, options.output_format);
    note_poses_alone(loaded.graph, options.output, format, session);
    write_graph(loaded.graph, options.output, registry, format);
    if (std::string lost = losses_not_written(loaded.graph); !lost.empty())
      summary.notes.push_back(std::move(lost));
  });
  const Stop& stop = options.problem.stop;
  app::note_the_end(summary, stop, loaded.graph);
  DiagonalCovariances covariances;
  if (covariance_solver && exit_code(summary, stop) == 0) {
    covariances =
        call_plugin([&] { return "covariances by " + in_words(spec); },
                    [&] { return diagonal_covariances(loaded.graph, *covariance_solver); });
    if (!covariances.there) summary.notes.push_back("no covariances: " + covariances.why_not);
  }
  results.write(options.record, [&] { recording->finish(loaded.graph, summary); });
  results.add(
      [&] { session.write_json(report_json(options, loaded, initial, summary, covariances)); });
  options.figures.write(Figures(summary), results);
  results.add([&] {
    session.print(summary_text(options, loaded, initial, summary, covariances, results, session));
  });
  results.finish();
  const int code = exit_code(summary, stop);
  return code == 0 && covariance_solver && !covariances.there
             ? static_cast<int>(ErrorCode::numerical)
             : code;
}

}  // namespace

void add_optimize(Registrar& registrar) {
  add_command<OptimizeOptions>(
      registrar, "optimize",
      "Example:\n"
      "  cairn optimize city.g2o -o best.g2o --linear-solver cholmod:ordering=metis --json "
      "run.json\n"
      "  cairn optimize @manhattan:poses=1000 --initial chordal --loss huber --loss-on loops\n"
      "Ctrl-C stops with the best estimate written. Names: cairn plugins; options: cairn plugins "
      "NAME",
      run);
}

}  // namespace cairn::app
