// SPDX-License-Identifier: BSD-3-Clause
#include "replay_report.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/step_times.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/album.hpp"
#include "cairn/program/error_metric.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/picture_files.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

/// How often covariances were updated in each way.
std::map<std::string, int> marginals_by(const Replay& replay) {
  std::map<std::string, int> counts;
  for (const ReplayStep& step : replay.steps)
    ++counts[std::string(to_string(step.report.marginals_by))];
  return counts;
}

auto sum_of(int UpdateReport::*member) {
  return [member](const Replay& replay) {
    std::int64_t sum = 0;
    for (const ReplayStep& step : replay.steps) sum += step.report.*member;
    return sum;
  };
}

/// A row of the table of steps.
struct StepRow {
  int number;  ///< from 1
  const ReplayStep* step;

  static ResultFields<StepRow> fields() {
    using R = StepRow;
    const auto of_report = [](auto UpdateReport::*member) {
      return [member](const R& r) { return r.step->report.*member; };
    };
    return ResultFields<R>()
        .figure("step", &R::number, "from 1")
        .figure(
            "variables", [](const R& r) { return r.step->variables; }, "of the graph, after it")
        .figure(
            "factors", [](const R& r) { return r.step->factors; }, "of the graph, after it")
        .figure(
            "seconds", [](const R& r) { return r.step->seconds; }, "s", "of the step")
        .part([](const R& r) { return r.step->report.seconds; })
        .without("total")
        .figure(
            "estimate", [](const R& r) { return r.step->estimate; }, "s", "reading the estimate")
        .figure("affected", of_report(&UpdateReport::affected_variables),
                "variables whose columns of the factor were recomputed, summed")
        .figure("relinearized", of_report(&UpdateReport::relinearized_factors),
                "factors besides the new ones")
        .figure("owed", of_report(&UpdateReport::owed),
                "factors whose relinearisation was deferred to later updates")
        .figure("iterations", of_report(&UpdateReport::iterations), "linear systems solved")
        .figure("ok", of_report(&UpdateReport::ok), "whether H was positive definite")
        .figure(
            "chi2", [](const R& r) { return r.step->chi2; }, "where it is known")
        .csv("{:.17g}")
        .figure("marginals_by", of_report(&UpdateReport::marginals_by),
                "how covariances were updated");
  }
};

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

}  // namespace

std::string_view status(const Replay& replay) {
  if (replay.interrupted) return "interrupted";
  if (replay.steps.empty()) return "converged";
  const UpdateReport& last = replay.steps.back().report;
  return !last.ok ? "not_positive_definite" : !last.converged ? "max_iterations" : "converged";
}

ResultFields<Replay> Replay::fields() {
  using R = Replay;
  const auto of_all = [](double BatchCheck::*member) {
    return [member](const R& r) {
      const bool complete =
          !r.checks.empty() && r.checks.back().step == static_cast<int>(std::ssize(r.steps));
      return complete ? std::optional(r.checks.back().*member) : std::nullopt;
    };
  };
  return ResultFields<R>()
      .figure(
          "status", [](const R& r) { return status(r); }, "how the last update ended")
      .part("steps",
            [](const R& r) {
              std::vector<double> times;
              for (const ReplayStep& step : r.steps) times.push_back(step.seconds);
              return StepTimes(std::move(times));
            })
      .figure("chi2.batch", of_all(&BatchCheck::batch),
              "of an optimisation of everything from the initial estimate")
      .round("{:.8g}")
      .figure("chi2.polished", of_all(&BatchCheck::polished),
              "of an optimisation of everything from the estimate")
      .round("{:.8g}")
      .part("seconds", &R::seconds)
      .without("seconds.total")
      .figure("seconds.total", &R::total, "s", "of all steps")
      .before("seconds.linearize")
      .figure("seconds.estimate", &R::estimate, "s", "reading estimates")
      .figure("affected_variables", sum_of(&UpdateReport::affected_variables),
              "variables whose columns of the factor were recomputed, summed")
      .figure("relinearized_factors", sum_of(&UpdateReport::relinearized_factors),
              "factors besides the new ones")
      .figure("iterations", sum_of(&UpdateReport::iterations), "linear systems solved")
      .figure(
          "owed", [](const R& r) { return r.steps.empty() ? 0 : r.steps.back().report.owed; },
          "factors whose relinearisation is deferred")
      .figure("failed_updates", &R::failed, "updates whose H was not positive definite")
      .figure("marginals_by", &marginals_by, "how often covariances were updated in each way")
      .figure("checks", &R::checks, "each comparison with batch optimisation")
      .figure("notes", &R::notes, "sentences for the user")
      .figure("doubts", &R::doubts, "those that give reason to doubt the estimate")
      .details();
}

json::object report_json(const ReplayOptions& options, const LoadedGraph& loaded, bool sorted,
                         const Replay& replay, const Estimator& estimator, double chi2) {
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
  if (options.keep > 0) {
    report["keep"] = {{"poses", options.keep},
                      {"select", options.select},
                      {"sparsifier", options.sparsifier},
                      {"removed", replay.removed},
                      {"dropped", replay.dropped},
                      {"kld", replay.kld},
                      {"variables", estimator.variable_count()},
                      {"factors", estimator.factor_count()}};
  }
  report["chi2"] = {{"final", chi2}};
  report["seconds"] = {{"read", loaded.seconds}};
  put(report, replay);
  report["estimator_memory_bytes"] = estimator.memory();
  report["read_notes"] = strings_json(sentences(loaded.report));
  report["output"] = text_json(options.output);
  end_report(report);
  return report;
}

std::string steps_csv(const Replay& replay) {
  CsvText csv(result_fields<StepRow>().all());
  int number = 0;
  for (const ReplayStep& step : replay.steps) csv.add(result_record(StepRow{++number, &step}));
  return csv.text();
}

void draw_steps(const Replay& replay, const ReplayOptions& options, const LoadedGraph& loaded,
                Session& session) {
  Album album = begin_album(options.graph, "cairn replay " + options.graph);
  Scene scene = scene_of(loaded.graph, short_name(options.graph));
  SceneRun run;
  run.name = options.estimator;
  run.summary.optimizer = options.estimator;
  for (const ReplayStep& step : replay.steps) {
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

std::string summary_text(const ReplayOptions& options, const LoadedGraph& loaded,
                         const Replay& replay, double chi2, const Results& results,
                         const Session& session) {
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  table.add({"graph", fmt::format("{}: {}, {}", loaded.name,
                                  plural(loaded.graph.variable_count(), "variable"),
                                  plural(loaded.graph.factor_count(), "factor"))});
  add_metric(table, loaded.graph, session);
  table.add({"estimator", options.estimator});
  if (options.keep > 0) {
    table.add({"kept", fmt::format("{} at most ({}): {} removed, divergence {:.4g} nats; {} of "
                                   "these dropped",
                                   plural(options.keep, "pose"), options.select, replay.removed,
                                   replay.kld, plural(replay.dropped, "measurement"))});
  }
  table.add({"chi2", chi2_text(chi2)});
  const Figures figures(replay);
  table.add({"time", figures.times("seconds", {"estimate"})});
  table.add({"steps", figures.steps("steps")});
  figures.add_rows(table);
  if (!replay.checks.empty()) table.add({"batch", checks_text(replay)});
  if (const int owed = replay.steps.empty() ? 0 : replay.steps.back().report.owed; owed > 0)
    table.add({"owed", plural(owed, "factor") + " to be relinearized"});
  if (replay.interrupted) table.add({"status", "interrupted"});
  if (replay.failed > 0)
    table.add({"failed", plural(replay.failed, "update") + ": H was not positive definite"});
  constexpr std::size_t kMostNotes = 5;
  add_notes(table, replay.notes, replay.doubts, kMostNotes);
  for (const std::string& file : results.written({options.output, options.steps, options.plot}))
    table.add({"output", file});
  return table.text(false);
}

}  // namespace cairn::app
