// SPDX-License-Identifier: BSD-3-Clause
// cairn sparsify GRAPH: takes nodes out of a graph and keeps their information in a few factors.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

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
#include "cairn/sparsification/sparsify_graph.hpp"
#include "information_frame.hpp"
#include "recording_redirection.hpp"
#include "sparsify.hpp"
#include "sparsify_edges.hpp"
#include "sparsify_records.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

constexpr std::size_t kRefusedShown = 5;

/// The component with its options given, one by one, besides those in its name.
SparsifyJob job_of(const SparsifyCommandOptions& options, Session& session) {
  SparsifyJob job;
  job.sparsifier = parse_component(options.sparsifier);
  const std::pair<const char*, std::string> given[] = {{"topology", options.topology},
                                                       {"recovery", options.recovery},
                                                       {"population", options.population},
                                                       {"scheme", options.scheme}};
  for (const auto& [name, value] : given) {
    if (!value.empty()) job.sparsifier.values.insert_or_assign(name, value);
  }
  choose_recovery(job.sparsifier);
  if (options.keep_every && !options.select.empty())
    throw Error(ErrorCode::usage, "--keep-every and --select both say which nodes leave: give one");
  job.selection =
      parse_component(options.keep_every ? fmt::format("keep_every:every={}", *options.keep_every)
                      : options.select.empty() ? SparsifyJob::kDefaultSelection
                                               : options.select);
  job.nodes = parse_enum<NodeKind>(options.nodes, "--nodes");
  job.optimizer = optimizer_spec(options.optimizer, "", session.registry());
  job.linear_solver = options.linear_solver;
  job.estimator = options.estimator;
  job.online = static_cast<int>(options.online.value_or(0));
  job.as_given = options.as_given;
  job.keep_minimum = !options.is_study;
  const bool beforehand = options.redirect == "beforehand";
  if (options.redirect != "late") {
    if (!options.keep_every || !options.online) {
      throw Error(
          ErrorCode::usage,
          fmt::format("--redirect {} needs --online and --keep-every: only then it is known "
                      "of each node whether it stays",
                      options.redirect));
    }
    job.redirect_early = static_cast<int>(*options.keep_every);
    job.redirection.to = RedirectionRule::To::order;
  }
  if ((!options.online || beforehand) && (!options.redirect_to.empty() || options.newer ||
                                          options.inflation != RedirectionRule{}.inflation)) {
    throw Error(ErrorCode::usage,
                "--redirect-to, --newer and --inflation are for factors that come late: they need "
                "--online, and --redirect late or early");
  }
  using To = RedirectionRule::To;
  for (const auto& [name, to] : {std::pair{"path", To::path},
                                 {"place", To::place},
                                 {"order", To::order},
                                 {"next", To::next}}) {
    if (options.redirect_to == name) job.redirection.to = to;
  }
  job.redirection.newer = options.newer;
  job.redirection.inflation = options.inflation;
  job.measure = !options.no_kld;
  if (options.compared_at == "minima") job.compared_at = ComparedAt::minima;
  return job;
}

/// Refuses, before a graph is read, what could not be written in the end.
void check_topology(const SparsifyCommandOptions& options, const SparsifyJob& job,
                    Registry& registry) {
  const auto given = job.sparsifier.values.find("topology");
  if (given == job.sparsifier.values.end()) return;
  const auto topology = registry.make<Topology>(given->second);
  if (!options.output.empty() && !topology->unwritable().empty()) {
    throw Error(ErrorCode::usage,
                fmt::format("--topology {} makes {}, which no format of graphs expresses: omit "
                            "--output to compare, or choose another topology to write",
                            given->second, topology->unwritable()));
  }
  if (!options.record.empty() && topology->whole()) {
    throw Error(ErrorCode::usage,
                fmt::format("--topology {} has no factors of pairs, which --record is for: choose "
                            "another topology to record problems",
                            given->second));
  }
}

json::object report_json(const SparsifyCommandOptions& options, const LoadedGraph& loaded,
                         const SparsifyJob& job, const SparsifyResult& result) {
  json::object report = begin_report("sparsify");
  report["graph"] = graph_json(loaded.graph, loaded.name);
  report["sparsifier"] = spec_text(job.sparsifier);
  report["selection"] = spec_text(job.selection);
  report["nodes"] = options.nodes;
  report["online"] = job.online;
  report["threads"] = threads();
  put(report, result);
  report["output"] = text_json(options.output);
  end_report(report);
  return report;
}

std::string summary_text(const SparsifyCommandOptions& options, const LoadedGraph& loaded,
                         const SparsifyJob& job, const SparsifyResult& result,
                         const Results& results, const Session& session) {
  const Figures figures(result);
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  table.add(
      {"graph", fmt::format("{}: {}, {}", loaded.name, plural(result.variables_before, "variable"),
                            plural(result.factors_before, "factor"))});
  add_metric(table, loaded.graph, session);
  const auto removed = static_cast<std::int64_t>(std::ssize(result.change.removed_variables));
  table.add({"removed",
             fmt::format("{} ({}{}), in {} whose neighbours are {} on average, {} at most",
                         plural(removed, "node"), spec_text(job.selection),
                         job.online > 0 ? fmt::format(", every {} poses", job.online) : "",
                         plural(result.change.problems, "problem"),
                         figures["problems.mean_blanket"], figures["problems.largest_blanket"])});
  table.add({"left", fmt::format("{}, {} ({})", plural(result.sparse.variable_count(), "variable"),
                                 plural(result.sparse.factor_count(), "factor"),
                                 spec_text(job.sparsifier))});
  if (result.error) {
    std::string text = fmt::format("KLD {} of the whole{}", figures["kld"], moved_text(result));
    if (job.online > 0 && std::isfinite(result.rmse_full))
      text += fmt::format(", from that with all measurements by {}", figures["rmse_full"]);
    table.add({"lost", text});
    if (std::isfinite(result.conservative_margin)) {
      std::string margin =
          fmt::format("{}, the smallest eigenvalue of Λ − Λ̆ (conservative from 0 on)",
                      figures["conservative_margin"]);
      if (result.conservative_margin < 0.0)
        margin += "; recovery ip, fd and ncfd take conservative=true";
      table.add({"margin", margin});
    }
  }
  const bool fitted = result.change.seconds.covariance > 0.0;
  table.add({"time", fmt::format("{}, select {}",
                                 figures.times("seconds", {"select", fitted ? "" : "covariance"}),
                                 figures["seconds.select"])});
  if (job.online > 0) {
    table.add({"a pose", figures.steps("steps")});
    table.add({"late", fmt::format("{} for nodes that had left redirected, {} dropped",
                                   plural(result.redirected, "factor"), result.dropped)});
  }
  figures.add_rows(table);
  if (figures["status"] != "converged") table.add({"status", figures["status"]});
  for (const std::string& file : results.written({options.output, options.record}))
    table.add({"output", file});
  return table.text(false);
}

SparsifyResult sparsify(const Graph& graph, const SparsifyJob& job, const ProblemSetup& setup,
                        Stop stop, const InterruptGuard& guard, SparsificationObserver observer,
                        Session& session) {
  stop.interrupt = &guard.flag();
  WorkProgress nodes(session.common.quiet);
  GuessProgress guess(session.common.quiet, guard.flag());
  OptimizationProgress iterations(session.common.quiet, stop.max_iterations);
  const SparsifySetting setting{
      .registry = session.registry(),
      .stop = stop,
      .loss = setup.loss(),
      .loss_on = setup.loss_selector(),
      .initialise = [&](Graph& whole) { return setup.apply(whole, std::ref(guess)); },
      .observer = std::move(observer),
      .optimisation = &iterations,
      .progress =
          [&](const SparsifyProgress& progress) {
            nodes.show(progress.part(), progress.to_string());
          }};
  return job.online > 0 ? sparsify_online(graph, job, setting)
                        : sparsify_whole(graph, job, setting);
}

void note_refused(const Sparsification& change, const Session& session) {
  for (std::size_t k = 0; k < std::min(kRefusedShown, change.refused.size()); ++k)
    session.note(fmt::format("not taken out: {}", change.refused[k].reason));
  if (change.refused.size() > kRefusedShown) {
    session.note(fmt::format("{} nodes in all were not taken out; --json names them",
                             change.refused.size()));
  }
}

}  // namespace

std::string moved_text(const SparsifyResult& result) {
  if (!result.error || !std::isfinite(result.error->rmse)) return "";
  const Figures figures(*result.error);
  return fmt::format("; the estimate has moved by {} (RMS), {} after alignment", figures["rmse"],
                     figures["rmse_aligned"]);
}

int run_sparsify(SparsifyCommandOptions options, Session& session) {
  if (options.as_given) keep_states(options.problem);
  session.use_threads();
  check_output(options.output, options.output_format, session);
  check_file(options.record, session);
  options.figures.check(session);
  if (!options.edges.empty()) return run_sparsify_edges(options, session);
  Registry& registry = session.registry();
  const SparsifyJob job = job_of(options, session);
  // A wrong name is refused before a graph is read.
  registry.make<Sparsifier>(job.sparsifier);
  registry.make<NodeSelection>(job.selection);
  check_topology(options, job, registry);
  const ProblemSetup setup(options.problem, registry);
  LoadedGraph loaded = load_graph(options.graph, options.input, session);
  RedirectedRecording redirected;
  const bool beforehand = options.redirect == "beforehand";
  if (beforehand)
    redirected = redirect_recording(loaded.graph, static_cast<int>(*options.keep_every));
  Graph& graph = beforehand ? redirected.graph : loaded.graph;
  // Once it is redirected: a measurement keeps the information that it has in the file.
  if (options.information_frame == "first") information_of_first_frame(graph);
  const InterruptGuard guard;
  ProblemRecorder recorder;
  SparsificationObserver observer;
  if (!options.record.empty())
    observer = [&](const SparsificationRecord& record) { recorder.add(record); };
  SparsifyResult result =
      sparsify(graph, job, setup, options.problem.stop, guard, std::move(observer), session);
  if (beforehand) {
    result.factors_before = loaded.graph.factor_count();
    result.redirected = redirected.redirected;
    result.dropped = redirected.dropped;
    // The run has not seen the measurements as they were.
    result.rmse_full = std::nan("");
  }
  for (const std::string& note : result.notes) session.note(note);
  note_refused(result.change, session);
  Results results;
  results.write(options.output, [&] {
    write_graph(result.sparse, options.output, registry,
                output_format(options.output, options.output_format));
  });
  results.write(options.record, [&] { write_file(options.record, recorder.text()); });
  options.figures.write(Figures(result), results);
  results.add([&] { session.write_json(report_json(options, loaded, job, result)); });
  results.add([&] { session.print(summary_text(options, loaded, job, result, results, session)); });
  results.finish();
  if (guard.interrupted()) return kExitInterrupted;
  return result.converged ? 0 : static_cast<int>(ErrorCode::numerical);
}

OptionFields<SparsifyCommandOptions> SparsifyCommandOptions::fields() {
  using O = SparsifyCommandOptions;
  return OptionFields<O>()
      .text("graph", &O::graph, kGraphHelp)
      .positional()
      .placeholder("GRAPH")
      .or_generated_by({"generator"})
      .required()
      .text("output", &O::output, "write the sparse graph")
      .letter('o')
      .placeholder("OUT")
      .component("to", &O::output_format, {"format"}, "format of OUT")
      .placeholder("FORMAT")
      .integer("keep_every", &O::keep_every, 1, 1e9,
               "one of so many nodes stays; --select for others")
      .component("select", &O::select, {"node_selection"},
                 "which leave: smallest_blanket, least_loss, nearest, oldest, coverage "
                 "[smallest_blanket:part=0.5]")
      .choice("nodes", &O::nodes, {"poses", "landmarks", "all"},
              "what may leave: poses, landmarks or all")
      .placeholder("KIND")
      .component("topology", &O::topology, {"topology"},
                 "pairs that get a factor: clt, cliquey, mi, dmi, ekld, mixed, odd, l1, best (of "
                 "all: minutes to hours); or one factor on all neighbours: glc [ekld]")
      .text("population", &O::population,
            "number of new factors: tree:γ, fill:α or loss:KLD [tree:2]")
      .placeholder("HOW")
      .component("recovery", &O::recovery, {"factor_recovery"},
                 "factor recovery: ncfd, fd, ip, pqn; closed_form for trees [ncfd]")
      .choice("scheme", &O::scheme, {"single", "runs", "multi"},
              "single: one by one; runs: those in a row together; multi: all connected ones "
              "[single]")
      .placeholder("HOW")
      .optional()
      .component("sparsifier", &O::sparsifier, {"sparsifier"},
                 "the sparsifier, with more options: sparsify:fit=graph")
      .component("edges", &O::edges, {"edge_selection"},
                 "remove loop closures instead, all poses stay: mac, greedy_tree, greedy_gain, l1, "
                 "random; :part=P of them stays")
      .integer("online", &O::online, 1, 1e9,
               "feed the graph pose by pose, and take nodes out every N poses")
      .component("estimator", &O::estimator, {"estimator"}, "online: the estimator")
      .component("optimizer", &O::optimizer, {"optimizer"}, "the optimizer, before and after")
      .component("linear_solver", &O::linear_solver, {"linear_solver"},
                 "the linear solver that gives determinants")
      .boolean("as_given", &O::as_given, "the graph is at its minimum: do not optimise it")
      .boolean("no_kld", &O::no_kld, "do not compute the divergence (KLD)")
      .part(&O::figures)
      .part(&O::problem)
      .part(&O::input);
}

void add_sparsify(Registrar& registrar) {
  add_command<SparsifyCommandOptions>(
      registrar, "sparsify",
      "Example:\n"
      "  cairn sparsify my.g2o -o sparse.g2o\n"
      "  cairn sparsify my.g2o --keep-every 5 --scheme runs --population tree:1.5 -o sparse.g2o\n"
      "  cairn sparsify my.g2o --edges greedy_gain:part=0.25 -o sparse.g2o",
      run_sparsify);
}

}  // namespace cairn::app
