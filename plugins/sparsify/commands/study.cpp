// SPDX-License-Identifier: BSD-3-Clause
// cairn study NAME: what the tables of the papers need and a robot does not.
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/latex_table.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "recovery_curves.hpp"
#include "sparsify.hpp"
#include "sparsify_records.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

/// Of `cairn sparsify` as in the thesis.
struct SparsifyStudyOptions {
  SparsifyCommandOptions sparsify;
  SparsifyStudyOptions() { sparsify.is_study = true; }

  static auto fields() {
    using O = SparsifyCommandOptions;
    return OptionFields<SparsifyStudyOptions>().part(
        &SparsifyStudyOptions::sparsify,
        O::fields()
            .choice("redirect", &O::redirect, {"late", "early", "beforehand"},
                    "online: factors to nodes that leave are redirected once these have left "
                    "(late), as soon as the nodes are measured again (early), or in the recording "
                    "along its odometry, as in the thesis (beforehand)")
            .placeholder("WHEN")
            .choice("redirect_to", &O::redirect_to, {"path", "place", "order", "next"},
                    "online: to the node with the most certain path of measurements, whose "
                    "covariances are added (path), the nearest in space (place) or by id (order), "
                    "or the next by id (next) [late: path, early: order]")
            .optional()
            .boolean("newer", &O::newer,
                     "online: of two that are equally near, the newer (place, order)")
            .real("inflation", &O::inflation, 0.0, 1e6,
                  "online: the covariance of the path is multiplied by this, since its error is "
                  "common to all factors that are redirected along it")
            .choice("information_frame", &O::information_frame, {"first", "second"},
                    "in the plane: the frame of whose translation a measurement's information is, "
                    "that of its second pose as measured, as in g2o (second), or that of its first "
                    "(first), as it seems to be in the thesis")
            .choice("compared_at", &O::compared_at, {"common", "minima"},
                    "for the KLD both graphs are linearised at the states of the original "
                    "(common), or each at its own minimum in world coordinates (minima), as in the "
                    "thesis")
            .placeholder("WHERE")
            .text("record", &O::record, "write every problem that comes up, as JSON")
            .placeholder("FILE"));
  }
};

// Problems ----------------------------------------------------------------------------------------

struct ProblemsOptions {
  std::string problems;
  std::vector<std::string> topologies{"ekld"}, recoveries{"ncfd"};
  std::string population = "tree:2";
  std::string curves, against = "time", latex;

  static auto fields() {
    using O = ProblemsOptions;
    return OptionFields<O>()
        .text("problems", &O::problems, "what cairn study sparsify --record has written")
        .positional()
        .placeholder("FILE")
        .required()
        .component("topology", &O::topologies, {"topology"},
                   "pairs that get a factor (repeatedly) [ekld]")
        .text("population", &O::population, "number of new factors: tree:γ or fill:α")
        .placeholder("HOW")
        .component("recovery", &O::recoveries, {"factor_recovery"},
                   "what finds their information (repeatedly) [ncfd]")
        .text("curves", &O::curves,
              "the mean KLD of each recovery and blanket size as it falls, as CSV")
        .placeholder("FILE")
        .text("latex", &O::latex, kLatexHelp)
        .placeholder("FILE")
        .choice("against", &O::against, {"time", "iterations"}, "of --curves: time or iterations")
        .placeholder("AXIS");
  }
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
  Results results;
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

}  // namespace

void add_study_sparsify(Registrar& registrar) {
  add_command<SparsifyStudyOptions>(
      registrar, "study sparsify",
      "Example:\n"
      "  cairn study sparsify city.g2o --keep-every 5 --online 100 --redirect early "
      "--record problems.json",
      [](const SparsifyStudyOptions& options, Session& session) {
        return run_sparsify(options.sparsify, session);
      });
}

void add_study_problems(Registrar& registrar) {
  add_command<ProblemsOptions>(
      registrar, "study problems",
      "Example:\n"
      "  cairn study problems problems.json --topology mi --recovery fd --recovery ncfd\n"
      "  cairn study problems problems.json --topology mi --recovery ip --recovery ncfd --curves "
      "kld.csv\n"
      "  cairn plot kld.csv --y '*@3' --y '*@8' --log xy -o kld.svg",
      solve_problems);
}

}  // namespace cairn::app
