// SPDX-License-Identifier: BSD-3-Clause
// cairn study NAME: what the tables of the papers need and a robot does not.
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "arguments.hpp"
#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "commands.hpp"
#include "compact.hpp"
#include "graph_files.hpp"
#include "interrupt.hpp"
#include "json_report.hpp"
#include "latex_table.hpp"
#include "progress.hpp"
#include "recovery_curves.hpp"
#include "results.hpp"
#include "sparsify.hpp"
#include "sparsify_records.hpp"
#include "study_objective.hpp"
#include "study_optimality.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

Command add_study_compact(ArgumentParser study) {
  auto options = std::make_shared<CompactOptions>();  // lives as long as the parser and the run
  options->is_study = true;
  ArgumentParser cli =
      study.add_command("compact", "cairn compact with a control, and beside everything");
  add_compact_options(cli, *options, {"apal", "apfl", "fpfl", "rfpfl"});
  cli.option("--strategy")
      .description(
          "all or few poses and loops: apal, apfl, fpfl; rfpfl at random, as many as fpfl "
          "[fpfl]");
  cli.add_option("--seed", options->seed, "of rfpfl").type_name("N").show_default();
  cli.add_option("--draw", options->draw,
                 "of rfpfl: loop closures first, with the poses at their ends, or poses first, and "
                 "then loop closures between those, as the authors do")
      .type_name("WHAT")
      .one_of({"loops", "poses"})
      .show_default();
  cli.add_option("--error-ratio", options->error_ratio,
                 "errors over those with all loops, at most, in the sample; 0: do not try")
      .type_name("X")
      .within(0.0, 1e9)
      .show_default();
  cli.add_option("--compare", options->compare,
                 "covariances beside those with everything, each step (slow), as CSV")
      .type_name("FILE");
  cli.footer(
      "Example:\n"
      "  cairn study compact city.g2o --thresholds city.json --strategy rfpfl --seed 3");
  return {cli, [options](Session& session) { return run_compact(*options, session); }};
}

Command add_study_sparsify(ArgumentParser study) {
  auto options = std::make_shared<SparsifyCommandOptions>();
  options->is_study = true;
  ArgumentParser cli = study.add_command(
      "sparsify", "cairn sparsify as in the thesis, and with its problems recorded");
  add_sparsify_options(cli, *options);
  cli.add_option(
         "--redirect", options->redirect,
         "online: factors to nodes that leave are redirected once these have left (late), as soon "
         "as the nodes are measured again (early), or in the recording along its odometry, as in "
         "the thesis (beforehand)")
      .type_name("WHEN")
      .one_of({"late", "early", "beforehand"})
      .show_default();
  cli.add_option(
         "--redirect-to", options->redirect_to,
         "online: to the node with the most certain path of measurements, whose covariances "
         "are added (path), the nearest in space (place) or by id (order), or the next by id "
         "(next) [late: "
         "path, early: order]")
      .type_name("WHICH")
      .one_of({"path", "place", "order", "next"});
  cli.add_flag("--newer", options->newer,
               "online: of two that are equally near, the newer (place, order)");
  cli.add_option("--inflation", options->inflation,
                 "online: the covariance of the path is multiplied by this, since its error is "
                 "common to all factors "
                 "that are redirected along it")
      .type_name("X")
      .within(0.0, 1e6)
      .show_default();
  cli.add_option(
         "--information-frame", options->information_frame,
         "in the plane: the frame of whose translation a measurement's information is, that of its "
         "second pose as measured, as in g2o (second), or that of its first (first), as it seems "
         "to be in the thesis")
      .type_name("WHICH")
      .one_of({"first", "second"})
      .show_default();
  cli.add_option(
         "--compared-at", options->compared_at,
         "for the KLD both graphs are linearised at the states of the original (common), or "
         "each at its own minimum in world coordinates (minima), as in the thesis")
      .type_name("WHERE")
      .one_of({"common", "minima"})
      .show_default();
  cli.add_option("--record", options->record, "write every problem that comes up, as JSON")
      .type_name("FILE");
  cli.footer(
      "Example:\n"
      "  cairn study sparsify city.g2o --keep-every 5 --online 100 --redirect early "
      "--record problems.json");
  return {cli, [options](Session& session) { return run_sparsify(*options, session); }};
}

// Problems ----------------------------------------------------------------------------------------

struct ProblemsOptions {
  std::string problems;
  std::vector<std::string> topologies{"ekld"}, recoveries{"ncfd"};
  std::string population = "tree:2";
  std::string curves, against = "time", latex;
};

json::array notes_json(const ReplayRow& row) {
  json::array all;
  for (const auto& [text, problems] : row.notes)
    all.push_back({{"text", text}, {"problems", problems}});
  return all;
}

/// Of the rows of all sizes, each text once.
void show_notes(const std::vector<ReplayRow>& rows, const Session& session) {
  std::set<std::string> shown;
  for (const ReplayRow& row : rows) {
    for (const auto& [text, problems] : row.notes) {
      if (row.nodes == 0 && shown.insert(text).second)
        session.note(fmt::format("{} of {} blankets: {}", problems, row.problems, text));
    }
  }
}

json::array rows_json(const std::vector<ReplayRow>& rows) {
  json::array all;
  for (const ReplayRow& row : rows) {
    all.push_back({{"topology", row.topology},
                   {"recovery", row.recovery},
                   {"nodes", row.nodes == 0 ? json::value(nullptr) : json::value(row.nodes)},
                   {"problems", row.problems},
                   {"refused", row.refused},
                   {"kld", row.kld},
                   {"kld_deviation", row.kld_deviation},
                   {"largest_excess", row.largest_excess},
                   {"factors", row.factors},
                   {"iterations", row.iterations},
                   {"not_converged", row.not_converged},
                   {"not_positive", row.not_positive},
                   {"notes", notes_json(row)},
                   {"seconds",
                    {{"topology", row.topology_seconds},
                     {"recovery", row.recovery_seconds},
                     {"recovery_median", row.recovery_median}}}});
  }
  return all;
}

int solve_problems(const ProblemsOptions& options, Session& session) {
  session.use_threads();
  session.files.add_input(options.problems);
  check_file(options.curves, session);
  check_file(options.latex, session);
  const std::vector<DenseBlanket> problems = read_problems(options.problems);
  const InterruptGuard guard;
  StatusLine line(session.common.quiet);
  RecoveryCurves curves(options.against == "time" ? RecoveryCurves::Against::seconds
                                                  : RecoveryCurves::Against::iterations);
  const std::vector<ReplayRow> rows = replay_problems(
      problems, options.topologies, options.population, options.recoveries,
      [&](std::size_t done) {
        if (done % 64 == 0)
          line.show(fmt::format("{} of {} problems solved", done, problems.size()));
        return !guard.interrupted();
      },
      session.registry(), options.curves.empty() ? nullptr : &curves);
  line.clear();
  show_notes(rows, session);
  Results results(session);
  results.write(options.curves, [&] { write_file(options.curves, csv_text(curves.table())); });
  json::object report = begin_report("study");
  report["file"] = options.problems;
  report["problems"] = problems.size();
  report["rows"] = rows_json(rows);
  report["status"] = guard.interrupted() ? "interrupted" : "converged";
  end_report(report);
  results.add([&] { session.write_json(report); });
  Table table({{"topology", Table::Align::left},
               {"recovery", Table::Align::left},
               {"nodes", Table::Align::right},
               {"problems", Table::Align::right},
               {"refused", Table::Align::right},
               {"KLD", Table::Align::right},
               {"excess", Table::Align::right},
               {"iterations", Table::Align::right},
               {"topology", Table::Align::right},
               {"recovery", Table::Align::right}});
  for (const ReplayRow& row : rows) {
    table.add({row.topology, row.recovery, row.nodes == 0 ? "all" : fmt::format("{}", row.nodes),
               fmt::format("{}", row.problems), fmt::format("{}", row.refused),
               fmt::format("{:.4g}", row.kld), fmt::format("{:.1e}", row.largest_excess),
               fmt::format("{:.1f}", row.iterations), seconds_text(row.topology_seconds),
               seconds_text(row.recovery_seconds)});
  }
  results.write(options.latex, [&] { write_file(options.latex, table.latex()); });
  results.add([&] { session.print(table.text(session.colour())); });
  results.finish();
  return guard.interrupted() ? kExitInterrupted : 0;
}

Command add_study_problems(ArgumentParser study) {
  auto options = std::make_shared<ProblemsOptions>();
  ArgumentParser cli = study.add_command(
      "problems", "solve recorded sparsification problems by each topology and recovery");
  cli.add_option("problems", options->problems, "what cairn study sparsify --record has written")
      .type_name("FILE")
      .required();
  cli.add_option("--topology", options->topologies, "pairs that get a factor (repeatedly) [ekld]")
      .component({"topology"})
      .repeatable();
  cli.add_option("--population", options->population, "number of new factors: tree:γ or fill:α")
      .type_name("HOW")
      .show_default();
  cli.add_option("--recovery", options->recoveries,
                 "what finds their information (repeatedly) [ncfd]")
      .component({"factor_recovery"})
      .repeatable();
  cli.add_option("--curves", options->curves,
                 "the mean KLD of each recovery and blanket size as it falls, as CSV")
      .type_name("FILE");
  add_latex_option(cli, options->latex);
  cli.add_option("--against", options->against, "of --curves: time or iterations")
      .type_name("AXIS")
      .one_of({"time", "iterations"})
      .show_default();
  cli.footer(
      "Example:\n"
      "  cairn study problems problems.json --topology mi --recovery fd --recovery ncfd\n"
      "  cairn study problems problems.json --topology mi --recovery ip --recovery ncfd --curves "
      "kld.csv\n"
      "  cairn plot kld.csv --y '*@3' --y '*@8' --log xy -o kld.svg");
  return {cli, [options](Session& session) { return solve_problems(*options, session); }};
}

}  // namespace

Command add_study(ArgumentParser program) {
  ArgumentParser cli = program.add_command("study", "what only the tables of papers need");
  cli.require_command();
  const std::vector<Command> studies = {add_study_compact(cli), add_study_sparsify(cli),
                                        add_study_problems(cli), add_study_objective(cli),
                                        add_study_optimality(cli)};
  cli.footer(
      "Example:\n"
      "  cairn study sparsify @manhattan --keep-every 5 --record problems.json\n"
      "  cairn study problems problems.json --recovery ncfd --recovery ip");
  return {cli, [studies](Session& session) {
            for (const Command& study : studies) {
              if (study.parser.parsed()) return study.run(session);
            }
            return 0;
          }};
}

}  // namespace cairn::app
