// SPDX-License-Identifier: BSD-3-Clause
// cairn evaluate ESTIMATE TRUTH: errors of a trajectory.
#include <memory>
#include <set>

#include <fmt/format.h>

#include "cairn/trajectory.hpp"
#include "commands.hpp"
#include "graph_files.hpp"
#include "json_report.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

struct EvaluateOptions {
  std::string estimate;
  std::string truth;
  InputOptions input;
};

std::int64_t missing_from(const Trajectory& poses, const Trajectory& other) {
  std::set<Id> ids;
  for (const TrajectoryPose& pose : other) ids.insert(pose.id);
  std::int64_t count = 0;
  for (const TrajectoryPose& pose : poses) count += !ids.contains(pose.id);
  return count;
}

void warn_of_missing(std::int64_t count, const std::string& in, const std::string& not_in,
                     const Session& session) {
  if (count == 0) return;
  session.note(fmt::format("{} of {} {} not in {} and left out", plural(count, "pose"), in,
                           count == 1 ? "is" : "are", not_in));
}

std::string table_text(const TrajectoryError& error, bool colour) {
  Table table({{fmt::format("{} compared", plural(error.poses, "pose")), Table::Align::left},
               {"translation [m]", Table::Align::right},
               {"rotation [deg]", Table::Align::right}});
  const auto row = [&](const char* name, double translation, double rotation) {
    table.add({name, fmt::format("{:.6g}", translation), fmt::format("{:.6g}", rotation)});
  };
  row("ATE (absolute, after rigid alignment)", error.ate_translation, error.ate_rotation);
  row("RPE (consecutive poses)", error.rpe_translation, error.rpe_rotation);
  row("RPE all to all (every pair)", error.rpe_all_translation, error.rpe_all_rotation);
  return table.text(colour);
}

json::object error_json(double translation, double rotation) {
  return {{"translation", translation}, {"rotation", rotation}};
}

int run(const EvaluateOptions& options, Session& session) {
  session.use_threads();
  const Trajectory estimate =
      trajectory(load_graph(options.estimate, options.input, session).graph);
  const Trajectory truth = trajectory(load_graph(options.truth, options.input, session).graph);
  const TrajectoryError error = compare(estimate, truth);
  const std::int64_t only_estimate = missing_from(estimate, truth);
  const std::int64_t only_truth = missing_from(truth, estimate);
  warn_of_missing(only_estimate, options.estimate, options.truth, session);
  warn_of_missing(only_truth, options.truth, options.estimate, session);

  json::object report = begin_report("evaluate");
  report["estimate"] = options.estimate;
  report["truth"] = options.truth;
  report["poses"] = {{"compared", error.poses},
                     {"only_in_estimate", only_estimate},
                     {"only_in_truth", only_truth}};
  report["ate"] = error_json(error.ate_translation, error.ate_rotation);
  report["rpe"] = error_json(error.rpe_translation, error.rpe_rotation);
  report["rpe_all"] = error_json(error.rpe_all_translation, error.rpe_all_rotation);
  session.write_json(report);
  session.print(table_text(error, session.colour()));
  return 0;
}

}  // namespace

Command add_evaluate(CLI::App& program) {
  auto options = std::make_shared<EvaluateOptions>();  // lives as long as the parser and the run
  CLI::App* app =
      program.add_subcommand("evaluate", "errors of an estimate against the ground truth");
  app->add_option("estimate", options->estimate, "graph or trajectory")
      ->type_name("ESTIMATE")
      ->required();
  app->add_option("truth", options->truth, "the same poses, by id, at their true places")
      ->type_name("TRUTH")
      ->required();
  add_input_options(*app, options->input);
  app->footer(
      "Root mean squares: ATE after the rigid motion that brings ESTIMATE nearest to TRUTH, RPE "
      "between\n"
      "consecutive poses, RPE all to all over every pair; translation in metres, rotation in "
      "degrees.\n\n"
      "Example:\n"
      "  cairn evaluate best.g2o truth.g2o --json errors.json");
  return {app, [options](Session& session) { return run(*options, session); }};
}

}  // namespace cairn::app
