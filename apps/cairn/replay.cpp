// SPDX-License-Identifier: BSD-3-Clause
// cairn replay GRAPH: the graph as it came about, measurement by measurement, into an estimator.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>

#include <fmt/format.h>

#include "album.hpp"
#include "cairn/evaluation/batch_comparison.hpp"
#include "cairn/online/recorded_graph.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/solve/estimator.hpp"
#include "commands.hpp"
#include "graph_files.hpp"
#include "help.hpp"
#include "interrupt.hpp"
#include "json_report.hpp"
#include "picture_files.hpp"
#include "problem_setup.hpp"
#include "progress.hpp"
#include "step_times.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;
using Clock = std::chrono::steady_clock;

struct ReplayOptions {
  std::string graph;
  std::string output;
  std::string output_format;
  InputOptions input;
  ProblemOptions problem;
  std::string estimator = "incremental_cholesky";
  std::string marginals = "none";
  bool estimate = false;
  bool finish = false;
  int solve_every = 1;
  double budget = 0.0;  ///< [s]
  int checks = 0;
  bool covariance_check = false;
  std::string steps;  ///< CSV file, or empty
  std::string plot;   ///< picture, or empty

  ReplayOptions() { problem.initial = "odometry"; }
};

/// One update of the estimator.
struct Step {
  int variables = 0, factors = 0;  ///< of the graph, after it
  UpdateReport report;
  double seconds = 0.0;   ///< of the update, and of reading the estimate where that is asked for
  double estimate = 0.0;  ///< the part that reading took
  bool solved = true;
  double chi2 = std::nan("");  ///< NaN: not known
};

struct Replay {
  std::vector<Step> steps;
  std::vector<BatchCheck> checks;
  UpdateSeconds seconds;  ///< sums over the steps
  double estimate = 0.0;  ///< [s] reading estimates
  double total = 0.0;     ///< [s] of all steps
  std::int64_t placed_as_given = 0;
  int failed = 0;  ///< updates whose H was not positive definite
  std::vector<std::string> notes;
  bool interrupted = false;
};

KeptMarginals kept_marginals(const std::string& name) {
  if (name == "last") return KeptMarginals::last;
  return name == "diagonal" ? KeptMarginals::diagonal : KeptMarginals::none;
}

/// Feeds a graph to an estimator, and takes the time.
class Feeder {
 public:
  Feeder(const Graph& whole, Estimator& estimator, const ReplayOptions& options)
      : whole_(whole), estimator_(estimator), options_(options) {}

  Step feed(const Arrival& arrival, bool solve, bool full, Replay& replay) {
    GraphUpdate update = arrival_update(whole_, arrival);
    if (options_.problem.initial != "as_given")
      replay.placed_as_given += leave_states_to_factors(update, estimator_);
    const UpdateOptions how{.defer = !solve, .full = full, .max_seconds = options_.budget};
    Step step;
    step.solved = solve;
    const auto begin = Clock::now();
    step.report = estimator_.update(update, how);
    const auto updated = Clock::now();
    if (options_.estimate || options_.marginals != "none") read_estimate();
    const auto end = Clock::now();
    step.seconds = std::chrono::duration<double>(end - begin).count();
    step.estimate = std::chrono::duration<double>(end - updated).count();
    for (const Variable& variable : update.variables) known_.push_back(variable.id);
    step.variables = estimator_.variable_count();
    step.factors = estimator_.factor_count();
    return step;
  }

 private:
  void read_estimate() {
    copy_.clear();
    for (const Id id : known_) {
      const std::span<const double> x = estimator_.state(id);
      copy_.insert(copy_.end(), x.begin(), x.end());
    }
  }

  const Graph& whole_;
  Estimator& estimator_;
  const ReplayOptions& options_;
  std::vector<Id> known_;
  std::vector<double> copy_;  // a reader's copy of the estimate
};

/// Where along the replay batch is compared, spread evenly, the last step among them.
std::vector<bool> sampled_steps(int steps, int samples) {
  std::vector<bool> sampled(static_cast<std::size_t>(steps), false);
  samples = std::min(samples, steps);
  for (int k = 1; k <= samples; ++k)
    sampled[static_cast<std::size_t>(static_cast<std::int64_t>(k) * steps / samples - 1)] = true;
  return sampled;
}

Replay replay_all(const Graph& whole, const std::vector<Arrival>& arrivals, Estimator& estimator,
                  BatchChecker* checker, const ReplayOptions& options, const InterruptGuard& guard,
                  const Session& session) {
  Replay replay;
  Feeder feeder(whole, estimator, options);
  StatusLine line(session.common.quiet);
  const int count = static_cast<int>(std::ssize(arrivals));
  const std::vector<bool> sampled = sampled_steps(count, checker ? options.checks : 0);
  auto shown = Clock::now();
  for (int k = 0; k < count && !guard.interrupted(); ++k) {
    const bool solve = (k + 1) % options.solve_every == 0 || k + 1 == count || sampled[k];
    Step step = feeder.feed(arrivals[k], solve, options.finish && k + 1 == count, replay);
    replay.seconds += step.report.seconds;
    replay.estimate += step.estimate;
    replay.total += step.seconds;
    replay.failed += !step.report.ok;
    for (const std::string& note : step.report.notes) replay.notes.push_back(note);
    if (checker) checker->add(arrivals[k]);
    if (sampled[k]) {
      replay.checks.push_back(checker->check(k + 1, estimator));
      step.chi2 = replay.checks.back().chi2;
    }
    replay.steps.push_back(std::move(step));
    const auto interval = std::chrono::milliseconds(line.on_terminal() ? 50 : 5000);
    if (Clock::now() - shown > interval) {
      shown = Clock::now();
      line.show(fmt::format("{} step {} of {}, {}", bar(double(k + 1) / count, 20), k + 1, count,
                            seconds_text(replay.total)));
    }
  }
  replay.interrupted = guard.interrupted();
  return replay;
}

// The report ------------------------------------------------------------------------------------

StepTimes step_times(const Replay& replay) {
  std::vector<double> seconds;
  for (const Step& step : replay.steps) seconds.push_back(step.seconds);
  return StepTimes(std::move(seconds));
}

json::array checks_json(const Replay& replay) {
  json::array all;
  for (const BatchCheck& check : replay.checks) {
    json::object one{{"step", check.step},
                     {"chi2", check.chi2},
                     {"batch", check.batch},
                     {"polished", check.polished},
                     {"excess", check.excess()}};
    if (check.covariance_difference) one["covariance_difference"] = *check.covariance_difference;
    all.push_back(std::move(one));
  }
  return all;
}

json::object marginals_by_json(const Replay& replay) {
  std::map<std::string_view, int> counts;
  for (const Step& step : replay.steps) ++counts[to_string(step.report.marginals_by)];
  json::object all;
  for (const auto& [by, count] : counts) all[by] = count;
  return all;
}

template <class Member>
std::int64_t sum(const Replay& replay, Member member) {
  return std::accumulate(
      replay.steps.begin(), replay.steps.end(), std::int64_t{0},
      [&](std::int64_t total, const Step& step) { return total + step.report.*member; });
}

std::string_view status(const Replay& replay) {
  if (replay.interrupted) return "interrupted";
  return !replay.steps.empty() && !replay.steps.back().report.ok ? "not_positive_definite"
                                                                 : "converged";
}

json::object report_json(const ReplayOptions& options, const LoadedGraph& loaded, bool sorted,
                         const Replay& replay, Estimator& estimator, double chi2) {
  json::object report = begin_report("replay");
  report["graph"] = graph_json(loaded.graph, loaded.name);
  report["estimator"] = options.estimator;
  report["initial"] = options.problem.initial;
  report["loss"] = text_json(options.problem.loss);
  report["marginals"] = options.marginals;
  report["threads"] = threads();
  report["sorted"] = sorted;
  report["solve_every"] = options.solve_every;
  report["budget"] = options.budget;
  report["finish"] = options.finish;
  report["status"] = status(replay);
  report["steps"] = step_times_json(step_times(replay));
  report["chi2"] = {{"final", chi2}};
  const bool complete = !replay.checks.empty() &&
                        replay.checks.back().step == static_cast<int>(std::ssize(replay.steps));
  json::object& of_chi2 = report["chi2"].as_object();
  of_chi2["batch"] = complete ? json::value(replay.checks.back().batch) : json::value(nullptr);
  of_chi2["polished"] =
      complete ? json::value(replay.checks.back().polished) : json::value(nullptr);
  report["seconds"] = {{"read", loaded.seconds},
                       {"total", replay.total},
                       {"linearize", replay.seconds.linearize},
                       {"order", replay.seconds.order},
                       {"factorize", replay.seconds.factorize},
                       {"solve", replay.seconds.solve},
                       {"check", replay.seconds.check},
                       {"marginals", replay.seconds.marginals},
                       {"estimate", replay.estimate}};
  report["affected_variables"] = sum(replay, &UpdateReport::affected_variables);
  report["relinearized_factors"] = sum(replay, &UpdateReport::relinearized_factors);
  report["iterations"] = sum(replay, &UpdateReport::iterations);
  report["owed"] = replay.steps.empty() ? 0 : replay.steps.back().report.owed;
  report["failed_updates"] = replay.failed;
  report["marginals_by"] = marginals_by_json(replay);
  report["checks"] = checks_json(replay);
  report["estimator_memory_bytes"] = estimator.memory();
  report["notes"] = strings_json(replay.notes);
  report["read_notes"] = strings_json(sentences(loaded.report));
  report["output"] = text_json(options.output);
  end_report(report);
  return report;
}

std::string steps_csv(const Replay& replay) {
  std::string text =
      "step,variables,factors,seconds,linearize,order,factorize,solve,check,marginals,estimate,"
      "affected,relinearized,owed,iterations,ok,chi2,marginals_by\n";
  int number = 0;
  for (const Step& step : replay.steps) {
    const UpdateSeconds& s = step.report.seconds;
    text += fmt::format("{},{},{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},",
                        ++number, step.variables, step.factors, step.seconds, s.linearize, s.order,
                        s.factorize, s.solve, s.check, s.marginals, step.estimate);
    text += fmt::format("{},{},{},{},{},{},{}\n", step.report.affected_variables,
                        step.report.relinearized_factors, step.report.owed, step.report.iterations,
                        step.report.ok ? 1 : 0,
                        std::isnan(step.chi2) ? "" : fmt::format("{:.17g}", step.chi2),
                        to_string(step.report.marginals_by));
  }
  return text;
}

/// The time of each step, as a curve; its chi2 where it is known.
void draw_steps(const Replay& replay, const ReplayOptions& options, const LoadedGraph& loaded,
                Session& session) {
  Album album = begin_album(options.graph, "cairn replay " + options.graph);
  Scene scene = scene_of(loaded.graph, short_name(options.graph));
  SceneRun run;
  run.name = options.estimator;
  run.summary.optimizer = options.estimator;
  for (const Step& step : replay.steps) {
    const int number = static_cast<int>(run.summary.iterations.size()) + 1;
    run.summary.iterations.push_back(
        {.number = number, .chi2 = step.chi2, .seconds = step.seconds});
  }
  scene.runs.push_back(std::move(run));
  album.scenes.push_back(std::move(scene));
  ComponentSpec picture{picture_format(options.plot, session), {}};
  if (picture.name != "html") picture.values["what"] = "steps";
  write_picture(album, picture, options.plot, session);
}

std::string phases_text(const Replay& replay) {
  const UpdateSeconds& s = replay.seconds;
  return fmt::format("{} (linearize {}, order {}, factorize {}, solve {}, check {}, marginals {})",
                     seconds_text(replay.total), seconds_text(s.linearize), seconds_text(s.order),
                     seconds_text(s.factorize), seconds_text(s.solve), seconds_text(s.check),
                     seconds_text(s.marginals));
}

std::string checks_text(const Replay& replay) {
  double worst = 0.0, covariance = 0.0;
  for (const BatchCheck& check : replay.checks) {
    worst = std::max(worst, check.excess());
    covariance = std::max(covariance, check.covariance_difference.value_or(0.0));
  }
  const BatchCheck& last = replay.checks.back();
  std::string text = fmt::format(
      "{}: at most {:.3g} % above batch; at the end {} beside {} (from the guess) and {} "
      "(polished)",
      plural(std::ssize(replay.checks), "check"), 100.0 * worst, chi2_text(last.chi2),
      chi2_text(last.batch), chi2_text(last.polished));
  if (last.covariance_difference)
    text += fmt::format("; covariances apart by at most {:.2g}", covariance);
  return text;
}

std::string summary_text(const ReplayOptions& options, const LoadedGraph& loaded,
                         const Replay& replay, double chi2) {
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  table.add({"graph", fmt::format("{}: {}, {}", loaded.name,
                                  plural(loaded.graph.variable_count(), "variable"),
                                  plural(loaded.graph.factor_count(), "factor"))});
  table.add({"estimator", options.estimator});
  table.add({"chi2", chi2_text(chi2)});
  table.add({"time", phases_text(replay)});
  table.add({"steps", step_times(replay).text()});
  if (!replay.checks.empty()) table.add({"batch", checks_text(replay)});
  if (const int owed = replay.steps.empty() ? 0 : replay.steps.back().report.owed; owed > 0)
    table.add({"owed", plural(owed, "factor") + " to be relinearized"});
  if (replay.interrupted) table.add({"status", "interrupted"});
  if (replay.failed > 0)
    table.add({"failed", plural(replay.failed, "update") + ": H was not positive definite"});
  constexpr std::size_t kMostNotes = 5;
  for (std::size_t k = 0; k < std::min(kMostNotes, replay.notes.size()); ++k)
    table.add({"note", replay.notes[k]});
  if (replay.notes.size() > kMostNotes)
    table.add({"", fmt::format("and {} more: --json", replay.notes.size() - kMostNotes)});
  for (const std::string& file : {options.output, options.steps, options.plot}) {
    if (!file.empty() && file != "-") table.add({"written", file});
  }
  return table.text(false);
}

void check(const ReplayOptions& options, Session& session) {
  if (options.output == "-") session.write_file_to_stdout();
  check_output(options.output, options.output_format, session);
  if (!options.steps.empty()) check_folder(options.steps);
  if (!options.plot.empty()) picture_format(options.plot, session);
  if (options.covariance_check && (options.checks == 0 || options.marginals != "diagonal")) {
    throw Error(ErrorCode::usage,
                "--covariance-check compares the kept block diagonal at the steps of --check: give "
                "--marginals diagonal and --check N as well");
  }
}

void keep(Estimator& estimator, const std::string& marginals) {
  if (marginals != "none") estimator.keep_marginals(kept_marginals(marginals));
}

int exit_code(const Replay& replay) {
  if (replay.interrupted) return kExitInterrupted;
  return status(replay) == "converged" ? 0 : static_cast<int>(ErrorCode::numerical);
}

int run(const ReplayOptions& options, Session& session) {
  check(options, session);
  session.use_threads();
  Registry& registry = session.registry();
  const auto estimator = registry.make<Estimator>(options.estimator);
  const ProblemSetup setup(options.problem, registry);
  keep(*estimator, options.marginals);
  estimator->set_loss(setup.loss(), setup.loss_selector());

  const LoadedGraph loaded = load_graph(options.graph, options.input, session);
  const std::vector<Arrival> arrivals = arrival_order(loaded.graph);
  const bool sorted = !in_arrival_order(arrivals);
  if (sorted)
    session.note("the file is not in the order of arrival: sorted by the ids of its poses");
  std::optional<BatchChecker> checker;
  if (options.checks > 0) {
    checker.emplace(loaded.graph,
                    BatchProblem{.loss = setup.loss(),
                                 .loss_on = setup.loss_selector(),
                                 .initialise = [&](Graph& graph) { setup.apply(graph); },
                                 .covariances = options.covariance_check},
                    registry);
  }

  const InterruptGuard guard;  // until the results are written
  const Replay replay = replay_all(loaded.graph, arrivals, *estimator,
                                   checker ? &*checker : nullptr, options, guard, session);
  if (replay.placed_as_given > 1) {
    session.note(fmt::format("{} the states of the file: no measurement determined them at first",
                             plural(replay.placed_as_given, "variable") + " began with"));
  }
  const double chi2 = estimator->chi2();
  if (!options.output.empty())
    write_graph(estimator->graph(), options.output, registry,
                output_format(options.output, options.output_format));
  if (!options.steps.empty()) write_file(options.steps, steps_csv(replay));
  if (!options.plot.empty()) draw_steps(replay, options, loaded, session);
  session.write_json(report_json(options, loaded, sorted, replay, *estimator, chi2));
  session.print(summary_text(options, loaded, replay, chi2));
  return exit_code(replay);
}

}  // namespace

Command add_replay(CLI::App& program) {
  auto options = std::make_shared<ReplayOptions>();  // lives as long as the parser and the run
  CLI::App* app = program.add_subcommand(
      "replay", "feed a graph to an estimator in the order of its measurements");
  app->add_option("graph", options->graph, kGraphHelp)->type_name("GRAPH")->required();
  app->add_option("-o,--output", options->output, "write the last estimate (- is standard output)")
      ->type_name("OUT");
  app->add_option("--to", options->output_format, "format of OUT, instead of by the ending")
      ->type_name("FORMAT");
  app->add_option("--estimator", options->estimator,
                  "the estimator, with options as NAME:key=value")
      ->type_name("NAME")
      ->capture_default_str();
  app->add_option("--marginals", options->marginals, "covariances kept: none, last or diagonal")
      ->type_name("WHICH")
      ->check(one_of({"none", "last", "diagonal"}))
      ->capture_default_str();
  app->add_option("--initial", options->problem.initial,
                  "new poses: odometry, from the estimate so far, or as_given in the file")
      ->type_name("HOW")
      ->check(one_of({"odometry", "as_given"}))
      ->capture_default_str();
  app->add_option("--solve-every", options->solve_every, "solve after every so many poses")
      ->type_name("N")
      ->check(within(1, 1000000000))
      ->capture_default_str();
  app->add_option("--budget", options->budget, "seconds that an update may take; 0: no limit")
      ->type_name("S")
      ->check(within(0.0, 1e9))
      ->default_str("0");
  app->add_flag("--finish", options->finish, "solve the last step for all digits, in its own time");
  app->add_flag("--estimate", options->estimate,
                "count the time of reading all states, every step");
  app->add_option("--check", options->checks,
                  "compare chi2 with batch at so many steps (not timed)")
      ->type_name("N")
      ->check(within(0, 1000000000))
      ->capture_default_str();
  app->add_flag("--covariance-check", options->covariance_check,
                "there, compare the covariances kept as well");
  app->add_option("--steps", options->steps, "a row of times and counts for each step, as CSV")
      ->type_name("FILE");
  app->add_option("--plot", options->plot, "draw the time of each step: .svg, .png or .pdf")
      ->type_name("FILE");
  add_loss_options(*app, options->problem);
  add_input_options(*app, options->input);
  app->footer(
      "A step is a new pose with what it sees; files in another order are sorted first.\n\n"
      "Example:\n"
      "  cairn replay city.g2o --marginals diagonal --check 50 --steps steps.csv\n"
      "  cairn replay city.g2o --estimator periodic_batch:every=50 --budget 0.005");
  return {app, [options](Session& session) { return run(*options, session); }};
}

}  // namespace cairn::app
