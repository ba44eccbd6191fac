// SPDX-License-Identifier: BSD-3-Clause
// cairn map LOG: the map of a floor from recorded scans.
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <boost/json/array.hpp>
#include <boost/json/object.hpp>

#include "cairn/exploration/map_log.hpp"
#include "cairn/exploration/map_truth.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/io/format_by_ending.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "floor_drawing.hpp"
#include "floors.hpp"
#include "slam_names.hpp"

namespace cairn::app {
namespace {

struct MapOptions {
  std::string log, output, graph, trajectory;
  // All poses, and more loop closures than information asks for, since they check each other.
  // People walk through real scans.
  SlamNames slam{
      .policy = "compact_pose:strategy=apfl,range=3,angle=3.14,loop_gain=0.8,reuse=false",
      .registration = "icp:most_conflict=0.1"};
  std::string loss = "cauchy:scale=2";
  MapLogOptions run;

  static auto fields() {
    using O = MapOptions;
    return OptionFields<O>()
        .text("log", &O::log, "a log of CARMEN: robot.clf, robot.clf.gz:range=15")
        .positional()
        .placeholder("LOG")
        .required()
        .text("output", &O::output, "write the map: map.yaml")
        .letter('o')
        .placeholder("OUT")
        .text("graph", &O::graph, "write the graph of the poses that are kept")
        .placeholder("FILE")
        .text("trajectory", &O::trajectory, "write all poses, those left out put back")
        .placeholder("FILE")
        .part(
            &O::run,
            OptionFields<MapLogOptions>()
                .real("step", &MapLogOptions::step, 0.0, 1000.0, "take a scan after so many metres")
                .placeholder("M")
                .real("turn", &MapLogOptions::turn, 0.0, 3.0, "or after such a turn [rad]")
                .placeholder("RAD")
                .part(&MapLogOptions::odometry,
                      OptionFields<OdometryModel>()
                          .real("odometry_error", &OdometryModel::relative, 0.0, 1.0,
                                "standard deviation of odometry, as a part of the motion; "
                                "corrected by matches")
                          .placeholder("PART")))
        .component("loss", &O::loss, {"loss"},
                   "robust loss of loop closures, such as cauchy:scale=2, or none")
        .part(&O::slam);
  }
};

struct MapOutcome {
  std::size_t logged = 0;
  MappedLog run;
  FloorMap map;
  ScanSlamCounts counts;
  Graph graph, trajectory;
  std::vector<Eigen::Vector2d> positions;
  double map_error = 0.0;          ///< `contradicted_area` [m²]
  std::vector<double> agreements;  ///< by scan: `scan_agreement`
  MapAgreement agreement;
  double width = 0.0, height = 0.0;  ///< of the trajectory, along its axes [m]
  double seconds = 0.0;
};

void check(const MapOptions& options, Session& session) {
  if (!options.output.empty()) check_map_file(options.output, "-o", session);
  check_output(options.graph, "", session, false);
  check_output(options.trajectory, "", session, false);
}

boost::json::object report_json(const MapOptions& options, const MapOutcome& outcome) {
  boost::json::object report = begin_report("map");
  report["log"] = options.log;
  report["policy"] = options.slam.policy;
  report["registration"] = options.slam.registration;
  report["mapper"] = options.slam.mapper;
  report["scans"] = {{"logged", outcome.logged}, {"used", outcome.run.scans}};
  report["duration"] = outcome.run.duration;
  report["distance"] = outcome.run.distance;
  report["extent"] = {outcome.width, outcome.height};
  report["kept"] = outcome.graph.variable_count();
  report["consecutive"] = {{"matched", outcome.counts.consecutive},
                           {"contradicted", outcome.counts.contradicted}};
  report["loops"] = {{"proposed", outcome.counts.proposed},
                     {"matched", outcome.counts.registered},
                     {"linked", outcome.counts.loops}};
  report["converged"] = outcome.run.converged;
  report["map"] = {{"cells", {outcome.map.frame.width, outcome.map.frame.height}},
                   {"resolution", outcome.map.frame.resolution},
                   {"coverage", outcome.map.coverage()},
                   {"entropy", outcome.map.entropy()},
                   {"error", outcome.map_error},
                   {"rebuilt", outcome.counts.rebuilt}};
  report["seconds"] = {{"total", outcome.seconds},
                       {"map", outcome.counts.map_seconds},
                       {"policy", outcome.counts.policy_seconds},
                       {"registration", outcome.counts.registration_seconds}};
  boost::json::array by_scan;
  for (const double part : outcome.agreements) by_scan.push_back(number_json(part));
  report["agreement"] = {{"mean", outcome.agreement.mean},
                         {"least", outcome.agreement.least},
                         {"least_from_scan", outcome.agreement.first},
                         {"scans", std::move(by_scan)}};
  report["notes"] = strings_json(outcome.counts.notes);
  return report;
}

std::string summary_text(const MapOutcome& outcome) {
  Table table({{"", Table::Align::left}, {"", Table::Align::left}});
  table.add({"log", fmt::format("{} of {}, {:.1f} m driven in {}", outcome.run.scans,
                                plural(static_cast<std::int64_t>(outcome.logged), "scan"),
                                outcome.run.distance, seconds_text(outcome.run.duration))});
  table.add({"map", fmt::format("{:.1f} m² known; the trajectory spans {:.1f} m × {:.1f} m",
                                outcome.map.coverage(), outcome.width, outcome.height)});
  table.add({"graph", fmt::format("{} of {} kept, {}", outcome.graph.variable_count(),
                                  plural(static_cast<std::int64_t>(outcome.run.scans), "pose"),
                                  plural(outcome.counts.loops, "loop closure"))});
  table.add(
      {"agreement", fmt::format("{:.1f} % of the ranges end at obstacles of the map; of the {} "
                                "scans in a row with the least, {:.0f} %",
                                100.0 * outcome.agreement.mean, kAgreementScans,
                                100.0 * outcome.agreement.least)});
  table.add(
      {"time", fmt::format("{}: {} mapping, {} estimating, {} matching scans",
                           seconds_text(outcome.seconds), seconds_text(outcome.counts.map_seconds),
                           seconds_text(outcome.counts.policy_seconds),
                           seconds_text(outcome.counts.registration_seconds))});
  return table.text(false);
}

/// The extent of points along their principal axes [m], the larger one first.
void measure(MapOutcome& outcome) {
  Eigen::Matrix2Xd points(2, static_cast<Eigen::Index>(outcome.positions.size()));
  for (Eigen::Index k = 0; k < points.cols(); ++k)
    points.col(k) = outcome.positions[static_cast<std::size_t>(k)];
  points.colwise() -= Eigen::Vector2d(points.rowwise().mean());
  const Eigen::Matrix2d spread = points * points.transpose();
  const double angle = 0.5 * std::atan2(2.0 * spread(0, 1), spread(0, 0) - spread(1, 1));
  const Eigen::Vector2d along(std::cos(angle), std::sin(angle)), across(-along.y(), along.x());
  const auto extent = [&](const Eigen::Vector2d& axis) {
    const Eigen::RowVectorXd values = axis.transpose() * points;
    return values.maxCoeff() - values.minCoeff();
  };
  outcome.width = extent(along);
  outcome.height = extent(across);
}

/// What to say of a map that does not explain its own scans.
std::string doubt(const MapOutcome& outcome) {
  const Eigen::Vector2d& at = outcome.positions[outcome.agreement.first];
  return fmt::format(
      "the map seems wrong around x {:.1f} m, y {:.1f} m: it explains {:.0f} % of the ranges of "
      "scans {} to {}; a wrong match may bend it there (other values of --loss, or a larger range "
      "or smaller loop_gain of --policy, may help), or the floor has changed",
      at.x(), at.y(), 100.0 * outcome.agreement.least, outcome.agreement.first,
      outcome.agreement.first + kAgreementScans - 1);
}

/// `guard`: made once the log is read, which may be a pipe.
MapOutcome map_of_log(const MapOptions& options, std::optional<InterruptGuard>& guard,
                      Session& session) {
  Registry& registry = session.registry();
  const auto policy = registry.make<PosePolicy>(parse_component(options.slam.policy));
  const auto registration = registry.make<Registration>(parse_component(options.slam.registration));
  const auto mapper = registry.make<Mapper>(parse_component(options.slam.mapper));
  session.files.add_input(parse_named_file(options.log).file.string());
  const ScanLog log = read_scan_log(options.log, registry);
  guard.emplace();
  MapOutcome outcome;
  outcome.logged = log.scans.size();
  ScanSlam slam(
      {.policy = *policy,
       .registration = *registration,
       .mapper = *mapper,
       .registry = registry,
       .match_consecutive = true,
       .loop_loss = options.loss == "none" ? nullptr : registry.make<Loss>(options.loss)});
  StatusLine line(session.common.quiet);
  auto shown = std::chrono::steady_clock::now();
  MapLogOptions run = options.run;
  run.interrupt = &guard->flag();
  run.progress = [&](std::size_t read) {
    const auto now = std::chrono::steady_clock::now();
    if (now - shown < std::chrono::milliseconds(line.on_terminal() ? 50 : 5000)) return;
    shown = now;
    const auto part = static_cast<double>(read) / static_cast<double>(log.scans.size());
    line.show(fmt::format("{} scan {} of {}: {}", bar(part, 20), read, log.scans.size(),
                          plural(slam.counts().loops, "loop closure")));
  };
  {
    const Timed timed(outcome.seconds);
    outcome.run = map_log(log, slam, run);
    outcome.map = slam.map();
  }
  outcome.map_error = contradicted_area(outcome.map, slam.scans(), slam.poses());
  outcome.agreements = scan_agreement(outcome.map, slam.scans(), slam.poses());
  outcome.agreement = map_agreement(outcome.agreements);
  outcome.counts = slam.counts();
  outcome.graph = policy->estimator().graph();
  outcome.trajectory = recovered_trajectory(*policy, Recovery::distribute);
  for (const Pose2& pose : slam.poses()) outcome.positions.emplace_back(pose.translation());
  measure(outcome);
  return outcome;
}

int run_map(const MapOptions& options, Session& session) {
  check(options, session);
  session.use_threads();
  std::optional<InterruptGuard> guard;  // until the results are written
  const MapOutcome outcome = map_of_log(options, guard, session);
  for (const std::string& note : outcome.counts.notes) session.note(note);
  Registry& registry = session.registry();
  Results results;
  const auto write = [&](const Graph& graph, const std::string& file) {
    results.write(file, [&] { write_graph(graph, file, registry, output_format(file, "")); });
  };
  results.write(options.output,
                [&] { write_grid(outcome.map.occupancy(), options.output, registry); });
  write(outcome.graph, options.graph);
  write(outcome.trajectory, options.trajectory);
  results.add([&] { session.write_json(report_json(options, outcome)); });
  results.add([&] {
    print_floor({.map = outcome.map, .trajectory = outcome.positions}, session);
    session.print(summary_text(outcome));
  });
  results.finish();
  if (guard->interrupted()) return kExitInterrupted;
  if (outcome.agreement.least < kPlausibleAgreement) session.note(doubt(outcome));
  if (outcome.run.converged) return 0;
  session.note("the estimate has not converged");
  return static_cast<int>(ErrorCode::numerical);
}

}  // namespace

void add_map(Registrar& registrar) {
  add_command<MapOptions>(registrar, "map",
                          "Example:\n"
                          "  cairn map robot.clf.gz -o map.yaml --graph robot.g2o",
                          run_map);
}

}  // namespace cairn::app
