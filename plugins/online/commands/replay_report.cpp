// SPDX-License-Identifier: BSD-3-Clause
#include "replay_report.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include <fmt/core.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/program/album.hpp"
#include "cairn/program/error_metric.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/picture_files.hpp"
#include "cairn/program/step_times.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

StepTimes step_times(const Replay& replay) {
  std::vector<double> seconds;
  for (const ReplayStep& step : replay.steps) seconds.push_back(step.seconds);
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
  for (const ReplayStep& step : replay.steps) ++counts[to_string(step.report.marginals_by)];
  json::object all;
  for (const auto& [by, count] : counts) all[by] = count;
  return all;
}

template <class Member>
std::int64_t sum(const Replay& replay, Member member) {
  return std::accumulate(
      replay.steps.begin(), replay.steps.end(), std::int64_t{0},
      [&](std::int64_t total, const ReplayStep& step) { return total + step.report.*member; });
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

}  // namespace

std::string_view status(const Replay& replay) {
  if (replay.interrupted) return "interrupted";
  if (replay.steps.empty()) return "converged";
  const UpdateReport& last = replay.steps.back().report;
  return !last.ok ? "not_positive_definite" : !last.converged ? "max_iterations" : "converged";
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
  report["doubts"] = strings_json(replay.doubts);
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
  for (const ReplayStep& step : replay.steps) {
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
  table.add({"time", phases_text(replay)});
  table.add({"steps", step_times(replay).text()});
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
