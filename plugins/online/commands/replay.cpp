// SPDX-License-Identifier: BSD-3-Clause
// cairn replay GRAPH: the graph as it came about, measurement by measurement, into an estimator.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <functional>
#include <memory>
#include <optional>

#include <fmt/core.h>
#include <boost/json/object.hpp>

#include "cairn/evaluation/batch_comparison.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/evaluation/undetermined.hpp"
#include "cairn/io/losses_not_written.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/picture_files.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/pose_remover.hpp"
#include "cairn/update/recorded_graph.hpp"
#include "replay_report.hpp"

namespace cairn::app {
namespace {

using Clock = std::chrono::steady_clock;

KeptMarginals kept_marginals(const std::string& name) {
  if (name == "last") return KeptMarginals::last;
  return name == "diagonal" ? KeptMarginals::diagonal : KeptMarginals::none;
}

/// Feeds a graph to an estimator, and takes the time.
class Feeder {
 public:
  /// `remover` may be null: all poses stay.
  Feeder(const Graph& whole, Estimator& estimator, PoseRemover* remover,
         const ReplayOptions& options)
      : whole_(whole), estimator_(estimator), remover_(remover), options_(options) {}

  ReplayStep feed(const Arrival& arrival, bool solve, bool full, Replay& replay) {
    GraphUpdate update = arrival_update(whole_, arrival);
    if (remover_) drop_unknown(update, replay);
    if (options_.problem.initial != "as_given")
      replay.placed_as_given += leave_states_to_factors(update, estimator_);
    const UpdateOptions how{.defer = !solve, .full = full, .max_seconds = options_.budget};
    ReplayStep step;
    step.solved = solve;
    const auto begin = Clock::now();
    if (remover_) make_room(update, replay);
    step.report = estimator_.update(update, how);
    const auto updated = Clock::now();
    if (options_.estimate || options_.marginals != "none") read_estimate();
    step.seconds = seconds_since(begin);
    step.estimate = seconds_since(updated);
    for (const Variable& variable : update.variables) known_.push_back(variable.id);
    step.variables = estimator_.variable_count();
    step.factors = estimator_.factor_count();
    return step;
  }

 private:
  /// Drops measurements of poses that have left the map.
  void drop_unknown(GraphUpdate& update, Replay& replay) const {
    const auto there = [&](Id id) {
      return estimator_.has(id) ||
             std::ranges::any_of(update.variables, [&](const Variable& v) { return v.id == id; });
    };
    replay.dropped +=
        static_cast<std::int64_t>(std::erase_if(update.factors, [&](const Factor& factor) {
          return !std::ranges::all_of(factor.variables, there);
        }));
  }

  void make_room(GraphUpdate& update, Replay& replay) {
    const PoseRemover::Removal removal = remover_->make_room(estimator_, options_.keep, update);
    for (const Id id : removal.update.removed_variables) std::erase(known_, id);
    replay.removed += std::ssize(removal.update.removed_variables);
    replay.kld += removal.kld;
    if (!removal.note.empty() && replay.removal_note.empty()) {
      replay.removal_note = removal.note;
      replay.notes.push_back(removal.note);
    }
    replay.notes.insert(replay.notes.end(), removal.notes.begin(), removal.notes.end());
    removal.add_to(update);
  }

  void read_estimate() {
    std::size_t at = 0;
    for (const Id id : known_) {
      const std::span<const double> x = estimator_.state(id);
      if (at + x.size() > copy_.size()) copy_.resize(2 * (at + x.size()));
      std::ranges::copy(x, copy_.begin() + static_cast<std::ptrdiff_t>(at));
      at += x.size();
    }
  }

  const Graph& whole_;
  Estimator& estimator_;
  PoseRemover* remover_;
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

/// Into `replay`, which has the steps so far where something throws.
void replay_all(const Graph& whole, const std::vector<Arrival>& arrivals, Estimator& estimator,
                PoseRemover* remover, BatchChecker* checker, const ReplayOptions& options,
                const InterruptGuard& guard, const Session& session, Replay& replay) {
  Feeder feeder(whole, estimator, remover, options);
  StatusLine line(session.common.quiet);
  const int count = static_cast<int>(std::ssize(arrivals));
  const std::vector<bool> sampled = sampled_steps(count, checker ? options.checks : 0);
  auto shown = Clock::now();
  for (int k = 0; k < count && !guard.interrupted(); ++k) {
    const bool solve = (k + 1) % options.solve_every == 0 || k + 1 == count || sampled[k];
    ReplayStep step = feeder.feed(arrivals[k], solve, options.finish && k + 1 == count, replay);
    replay.seconds += step.report.seconds;
    replay.estimate += step.estimate;
    replay.total += step.seconds;
    replay.failed += !step.report.ok;
    for (const std::string& note : step.report.notes) {  // what is free is said at every update
      if (std::ranges::find(replay.notes, note) == replay.notes.end()) replay.notes.push_back(note);
    }
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
}

void check(const ReplayOptions& options, Session& session) {
  check_output(options.output, options.output_format, session);
  check_file(options.steps, session);
  if (!options.plot.empty()) check_picture(options.plot, session);
  if (options.keep > 0 && options.checks > 0) {
    throw Error(ErrorCode::usage,
                "--check compares chi2 with batch of all measurements, which is not that of a map "
                "with --keep: omit one of them");
  }
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

  std::unique_ptr<PoseRemover> remover;
  if (options.keep > 0) {
    remover = registry.make<PoseRemover>(ComponentSpec{
        "sparsify", {{"sparsifier", options.sparsifier}, {"selection", options.select}}});
  }

  const LoadedGraph loaded = load_graph(options.graph, options.input, session);
  const std::vector<Arrival> arrivals = arrival_order(loaded.graph);
  const bool sorted = !in_arrival_order(arrivals);
  if (sorted)
    session.note("the file is not in the order of arrival: sorted by the ids of its poses");
  const InterruptGuard guard;  // until the results are written
  GuessProgress guess(session.common.quiet, guard.flag());
  std::optional<BatchChecker> checker;
  if (options.checks > 0) {
    checker.emplace(
        loaded.graph,
        BatchProblem{.loss = setup.loss(),
                     .loss_on = setup.loss_selector(),
                     .initialise = [&](Graph& graph) { setup.apply(graph, std::ref(guess)); },
                     .covariances = options.covariance_check},
        registry);
  }

  Replay replay;
  std::exception_ptr failure;  // which costs the rest of the recording, not the estimate so far
  try {
    call_plugin([&] { return fmt::format("estimator '{}'", options.estimator); },
                [&] {
                  replay_all(loaded.graph, arrivals, *estimator, remover.get(),
                             checker ? &*checker : nullptr, options, guard, session, replay);
                });
  } catch (const Error& error) {
    if (error.code() != ErrorCode::plugin) throw;
    failure = std::current_exception();
  }
  Results results;
  if (failure) results.add([&] { std::rethrow_exception(failure); });
  results.write(options.output, [&] {
    const Graph graph = estimator->graph();
    const std::string format = output_format(options.output, options.output_format);
    note_poses_alone(graph, options.output, format, session);
    write_graph(graph, options.output, registry, format);
    if (std::string lost = losses_not_written(graph); !lost.empty())
      replay.notes.push_back(std::move(lost));
  });
  results.write(options.steps, [&] { write_file(options.steps, steps_csv(replay)); });
  if (failure) results.finish();  // throws
  if (replay.placed_as_given > 1) {
    session.note(fmt::format("{} the states of the file: no measurement determined them at first",
                             plural(replay.placed_as_given, "variable") + " began with"));
  }
  const double chi2 = estimator->chi2();
  if (!replay.interrupted) {
    NotesOnEstimate said = notes_on_estimate(estimator->graph(), chi2);
    if (!replay.steps.empty()) replay.doubts = replay.steps.back().report.doubts;
    replay.notes.insert(replay.notes.end(), said.notes.begin(), said.notes.end());
    replay.doubts.insert(replay.doubts.end(), said.doubts.begin(), said.doubts.end());
    note_what_is_free(estimator->graph(), replay.notes);
  }
  results.add(
      [&] { session.write_json(report_json(options, loaded, sorted, replay, *estimator, chi2)); });
  // Last of the files: libraries for fonts may end the process where memory is short.
  results.write(options.plot, [&] { draw_steps(replay, options, loaded, session); });
  results.add(
      [&] { session.print(summary_text(options, loaded, replay, chi2, results, session)); });
  results.finish();
  return exit_code(replay);
}

}  // namespace

OptionFields<ReplayOptions> ReplayOptions::fields() {
  using O = ReplayOptions;
  return OptionFields<O>()
      .text("graph", &O::graph, kGraphHelp)
      .positional()
      .placeholder("GRAPH")
      .or_generated_by({"generator"})
      .required()
      .text("output", &O::output, "write the last estimate (- is standard output)")
      .letter('o')
      .placeholder("OUT")
      .component("to", &O::output_format, {"format"}, "format of OUT, instead of by the ending")
      .placeholder("FORMAT")
      .component("estimator", &O::estimator, {"estimator"},
                 "the estimator, with options as NAME:key=value")
      .choice("marginals", &O::marginals, {"none", "last", "diagonal"},
              "covariances kept: none, last or diagonal")
      .part(&O::problem,
            OptionFields<ProblemOptions>()
                .choice("initial", &ProblemOptions::initial, {"odometry", "as_given"},
                        "new poses: odometry, from the estimate so far, or as_given in the file")
                .placeholder("HOW"))
      .integer("solve_every", &O::solve_every, 1, 1e9, "solve after every so many poses")
      .real("budget", &O::budget, 0.0, 1e9, "seconds that an update may take; 0: no limit")
      .placeholder("S")
      .integer("keep", &O::keep, 2, 1e9,
               "keep so many poses: others are sparsified as new ones come; 0: all")
      .or_zero()
      .component("select", &O::select, {"node_selection"}, "which poses leave with --keep")
      .component("sparsifier", &O::sparsifier, {"sparsifier"}, "what replaces them by factors")
      .boolean("finish", &O::finish, "relinearise and solve the last step to convergence")
      .boolean("estimate", &O::estimate, "count the time of reading all states, every step")
      .integer("check", &O::checks, 0, 1e9, "compare chi2 with batch at so many steps (not timed)")
      .boolean("covariance_check", &O::covariance_check,
               "there, compare the covariances kept as well")
      .text("steps", &O::steps, "a row of times and counts for each step, as CSV")
      .placeholder("FILE")
      .text("plot", &O::plot, "draw the time of each step: .svg, .png or .pdf")
      .placeholder("FILE")
      .part(&O::problem, ProblemOptions::loss_fields())
      .part(&O::input);
}

void add_replay(Registrar& registrar) {
  add_command<ReplayOptions>(
      registrar, "replay",
      "A step is a new pose with what it sees; files in another order are sorted first.\n\n"
      "Example:\n"
      "  cairn replay city.g2o --marginals diagonal --check 50 --steps steps.csv\n"
      "  cairn replay city.g2o --estimator periodic_batch:every=50 --budget 0.005",
      run);
}

}  // namespace cairn::app
