// SPDX-License-Identifier: BSD-3-Clause
// cairn evaluate ESTIMATE TRUTH: errors of a trajectory, and the divergence of two graphs.
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/evaluation/graph_divergence.hpp"
#include "cairn/evaluation/trajectory.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/covariances.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/latex_table.hpp"
#include "cairn/program/problem_setup.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/runtime/result_fields.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

constexpr int kDigits = 6;  // of a divergence, which is compared with others

/// One of the two trajectories.
struct TrajectoryOptions {
  std::string file;
  std::string stamps;  ///< file of time stamps; empty: those of the trajectory's own file, if any
  std::string axes = "robot";

  /// --stamps and --axes of ESTIMATE, or with "truth_" before them those of TRUTH.
  static auto fields(const std::string& prefix, const std::string& of) {
    using O = TrajectoryOptions;
    return OptionFields<O>()
        .text(prefix + "stamps", &O::stamps,
              "time stamps of " + of + ", one per line, by rising id")
        .placeholder("FILE")
        .choice(prefix + "axes", &O::axes, {"robot", "camera"},
                "of " + of + ": robot (x ahead, z up) or camera (z ahead, y down)")
        .placeholder("AXES");
  }
  static auto file_field(const std::string& name, const char* placeholder, const char* help) {
    return OptionFields<TrajectoryOptions>()
        .text(name, &TrajectoryOptions::file, help)
        .positional()
        .placeholder(placeholder)
        .required();
  }
};

struct EvaluateOptions {
  TrajectoryOptions estimate, truth;
  InputOptions input;
  std::string match;  ///< id or stamp; empty: what fits the files
  std::optional<double> offset, max_time_difference;
  bool planar = false;
  bool scale = false;
  bool kld = false;
  std::string compared_at = "common";
  std::string linear_solver = kDefaultLinearSolver;  ///< of the KLD
  std::string csv, latex;

  static auto fields() {
    using O = EvaluateOptions;
    constexpr double kAny = std::numeric_limits<double>::infinity();
    return OptionFields<O>()
        .part(&O::estimate,
              TrajectoryOptions::file_field("estimate", "ESTIMATE", "graph or trajectory"))
        .part(&O::truth, TrajectoryOptions::file_field(
                             "truth", "TRUTH", "the same poses, by id or time, where they were"))
        .choice("match", &O::match, {"id", "stamp"},
                "pair poses by id or stamp; else by stamp where both have times. id: row numbers "
                "are ids where a file has none")
        .placeholder("BY")
        .optional()
        .real("max_time_difference", &O::max_time_difference, 0.0, kAny,
              "how far apart the stamps of a pair may be [s] [0.01]")
        .placeholder("S")
        .real("offset", &O::offset, -kAny, kAny, "added to the stamps of ESTIMATE [s] [0]")
        .placeholder("S")
        .part(&O::estimate, TrajectoryOptions::fields("", "ESTIMATE"))
        .part(&O::truth, TrajectoryOptions::fields("truth_", "TRUTH"))
        .boolean("planar", &O::planar, "compare x, y and yaw only, as seen on a map")
        .boolean("align_scale", &O::scale,
                 "align with a scale too, which the estimate of one camera lacks")
        .boolean("kld", &O::kld,
                 "also D(TRUTH||ESTIMATE) of two graphs on the variables of both, in nats")
        .choice("compared_at", &O::compared_at, {"common", "minima"},
                "for --kld both are linearised at the states of TRUTH (common), or each at its "
                "own (minima)")
        .placeholder("WHERE")
        .component("linear_solver", &O::linear_solver, {"linear_solver"},
                   "gives covariances for --kld")
        .text("csv", &O::csv, "the errors as CSV, a line of titles and one of values")
        .placeholder("FILE")
        .text("latex", &O::latex, kLatexHelp)
        .placeholder("FILE")
        .part(&O::input);
  }

  StampMatching matching() const {
    StampMatching m;
    m.offset = offset.value_or(m.offset);
    m.max_difference = max_time_difference.value_or(m.max_difference);
    return m;
  }
};

// Reading -----------------------------------------------------------------------------------------

Trajectory stamped(Trajectory poses, const std::vector<double>& stamps,
                   const TrajectoryOptions& options, const Session& session) {
  if (stamps.size() != poses.size()) {
    throw Error(ErrorCode::input,
                fmt::format("{}: {} for {} of {}; expected one for each pose, by rising id",
                            options.stamps.empty() ? options.file : options.stamps,
                            plural(static_cast<std::int64_t>(stamps.size()), "stamp"),
                            plural(static_cast<std::int64_t>(poses.size()), "pose"), options.file));
  }
  std::vector<std::string> notes;
  poses = with_stamps(std::move(poses), stamps, notes);
  for (const std::string& note : notes) session.note(options.stamps + ": " + note);
  return poses;
}

Trajectory trajectory_of(const LoadedGraph& loaded, const TrajectoryOptions& options,
                         const EvaluateOptions& all, Session& session) {
  Trajectory poses = trajectory(loaded.graph);
  if (!options.stamps.empty()) {
    session.files.add_input(options.stamps);
    std::vector<std::string> notes;
    const std::vector<double> stamps = read_stamps(options.stamps, notes);
    for (const std::string& note : notes) session.note(note);
    poses = stamped(std::move(poses), stamps, options, session);
  } else if (!loaded.report.stamps.empty()) {
    poses = stamped(std::move(poses), loaded.report.stamps, options, session);
  }
  if (options.axes == "camera") poses = camera_to_robot_axes(std::move(poses));
  if (all.planar) poses = projected_to_plane(std::move(poses));
  return poses;
}

// Pairs -------------------------------------------------------------------------------------------

/// What was asked for that only stamps can do; empty if nothing was.
std::string option_about_stamps(const EvaluateOptions& options) {
  if (!options.estimate.stamps.empty()) return "--stamps";
  if (!options.truth.stamps.empty()) return "--truth-stamps";
  if (options.offset) return "--offset";
  if (options.max_time_difference) return "--max-time-difference";
  return options.match == "stamp" ? "--match stamp" : "";
}

void need_stamps(const Trajectory& poses, const std::string& file, const std::string& reason,
                 const std::string& remedy) {
  if (poses.empty() || poses.front().stamp) return;
  throw Error(ErrorCode::usage, fmt::format("{}: has no time stamps, which {} asks for; give them "
                                            "with {} FILE, one per line",
                                            file, reason, remedy));
}

bool match_by_stamp(const EvaluateOptions& options, const Trajectory& estimate,
                    const Trajectory& truth) {
  const std::string reason = option_about_stamps(options);
  if (reason.empty()) return options.match != "id" && stamps_tell_more(estimate, truth);
  if (options.match == "id") {
    throw Error(ErrorCode::usage,
                fmt::format("--match id does not look at time stamps; leave out {}", reason));
  }
  need_stamps(estimate, options.estimate.file, reason, "--stamps");
  need_stamps(truth, options.truth.file, reason, "--truth-stamps");
  return true;
}

void warn_of_missing(std::int64_t count, const std::string& in, const std::string& not_in,
                     bool by_stamp, const Session& session) {
  if (count == 0) return;
  const char* const be = count == 1 ? "is" : "are";
  const std::string verb =
      by_stamp ? (count == 1 ? "has no match" : "have no match") : fmt::format("{} not", be);
  session.note(fmt::format("{} of {} {} in {} and {} left out", plural(count, "pose"), in, verb,
                           not_in, be));
}

/// Of poses as they are compared; graphs of the plane have no height to be wrong.
void warn_of_dimensions(const LoadedGraph& estimate, const LoadedGraph& truth,
                        const Trajectory& poses, const Trajectory& true_poses,
                        const Session& session) {
  const bool planar_estimate = is_planar(estimate.graph) && !is_planar(true_poses);
  const bool planar_truth = is_planar(truth.graph) && !is_planar(poses);
  if (!planar_estimate && !planar_truth) return;
  session.note(fmt::format(
      "{} is of the plane and {} in space: heights, roll and pitch count as "
      "errors; --planar compares x, y and yaw alone",
      (planar_estimate ? estimate : truth).label, (planar_estimate ? truth : estimate).label));
}

/// How poses were paired, in the words of results.
struct Pairing {
  TrajectoryPairs pairs;
  bool by_stamp = false;
  RowPairing rows = RowPairing::none;
  std::string text;  ///< ", matched by time"
};

/// Refuses, or notes, what rests on the numbers of rows.
void judge_rows(const Pairing& pairing, const EvaluateOptions& options, bool estimate_rows,
                const Session& session) {
  if (options.match == "id" || pairing.rows == RowPairing::none) return;
  const TrajectoryPairs& pairs = pairing.pairs;
  const std::string& rows = estimate_rows ? options.estimate.file : options.truth.file;
  const bool estimate_timed = pairs.estimate.front().stamp.has_value();
  const bool truth_timed = pairs.truth.front().stamp.has_value();
  const std::string times =
      estimate_timed == truth_timed
          ? "with the times of both, --stamps FILE and --truth-stamps FILE, poses are paired by "
            "time"
          : fmt::format("{} FILE, the times of {}, one per line, pairs poses by time",
                        estimate_timed ? "--truth-stamps" : "--stamps",
                        estimate_timed ? options.truth.file : options.estimate.file);
  const std::string left_out =
      plural(pairs.only_in_estimate + pairs.only_in_truth, "pose") + " left without a partner";
  if (pairing.rows == RowPairing::unfounded) {
    throw Error(
        ErrorCode::input,
        fmt::format("{}: has times and no ids, so that pose k would be compared with row "
                    "k, and {}: that means nothing where rows were taken at other times; "
                    "{}; --match id compares by row all the same",
                    truth_timed ? options.truth.file : options.estimate.file, left_out, times));
  }
  if (pairing.rows == RowPairing::partial) {
    session.note(
        fmt::format("{}: has no ids, and pose k is compared with row k, with {}: right if "
                    "ids are row numbers; {}; --match id takes them for it without a note",
                    rows, left_out, times));
  } else if (estimate_timed || truth_timed) {
    session.note(fmt::format("{}: has no ids, and pose k is compared with row k of as many; {}",
                             rows, times));
  }
}

std::string pairing_text(const Pairing& pairing) {
  if (pairing.by_stamp) return ", matched by time";
  return pairing.rows == RowPairing::none ? ", matched by id" : ", id k with row k";
}

Pairing pair(const Trajectory& estimate, const Trajectory& truth, const LoadedGraph& estimate_graph,
             const LoadedGraph& truth_graph, const EvaluateOptions& options,
             const Session& session) {
  Pairing result;
  result.by_stamp = match_by_stamp(options, estimate, truth);
  if (result.by_stamp) {
    result.pairs = pair_by_stamp(estimate, truth, options.matching());
  } else {
    result.pairs = pair_by_id(estimate, truth);
    const bool estimate_rows = estimate_graph.report.row_ids;
    result.rows = row_pairing(result.pairs, estimate_rows, truth_graph.report.row_ids);
    judge_rows(result, options, estimate_rows, session);
  }
  result.text = pairing_text(result);
  return result;
}

// Doubts ------------------------------------------------------------------------------------------

void suggest_scale(const TrajectoryPairs& pairs, const EvaluateOptions& options,
                   const TrajectoryError& error, const Session& session) {
  if (options.scale) return;
  const std::optional<double> scale = explaining_scale(pairs);
  if (!scale) return;
  const TrajectoryError scaled = compare(pairs, Alignment::similarity);
  session.note(
      fmt::format("{} times as large, the estimate has an ATE of {:.6g} m instead of "
                  "{:.6g} m; --align-scale compares it so, as is usual for a single camera",
                  fmt::format("{:.6g}", *scale), scaled.ate_translation, error.ate_translation));
}

void suggest_axes(const TrajectoryPairs& pairs, const EvaluateOptions& options,
                  const TrajectoryError& error, const Session& session) {
  if (options.planar) return;
  if (const auto axes = camera_axes_of_one(pairs, error.ate_rotation)) {
    session.note(fmt::format(
        "with {} camera the ATE in rotation is {:.6g} deg instead of {:.6g} "
        "deg: one of the two is in the axes of a camera, the other of a robot",
        axes->of_estimate ? "--axes" : "--truth-axes", axes->ate_rotation, error.ate_rotation));
  }
}

/// Orientations that are far off, and agree when w of the quaternions of one of the two stands at
/// the other end, as in files that have EuRoC's order without names of columns.
void suggest_order(const TrajectoryPairs& pairs, const EvaluateOptions& options,
                   const LoadedGraph& estimate, const LoadedGraph& truth,
                   const TrajectoryError& error, const Session& session) {
  constexpr double kFar = 45.0, kShare = 0.1;  // [deg], of the error
  if (error.ate_rotation < kFar || options.planar) return;
  for (const LoadedGraph* loaded : {&estimate, &truth}) {
    const bool w_first = loaded->report.format == "tum";  // in truth, not as it was read
    if (!w_first && loaded->report.format != "euroc") continue;
    TrajectoryPairs other = pairs;
    Trajectory& poses = loaded == &estimate ? other.estimate : other.truth;
    poses = with_quaternions_of_order(std::move(poses), w_first);
    const double left = rotation_error(other);
    if (left > kShare * error.ate_rotation) continue;
    session.note(fmt::format(
        "with w of the quaternions of {} {}, the ATE in rotation is {:.6g} deg instead of {:.6g} "
        "deg; `cairn convert {} mended.tum --from {}` reads them so",
        loaded->name, w_first ? "first" : "last", left, error.ate_rotation, loaded->name,
        w_first ? "euroc" : "tum"));
    return;
  }
}

// Divergence --------------------------------------------------------------------------------------

/// D(TRUTH‖ESTIMATE) that was asked for. Without an error: it could not be computed.
struct GraphDivergence {
  std::optional<SparsificationError> error;
  std::size_t variables = 0;  ///< compared
};

void need_factors(const LoadedGraph& loaded) {
  if (loaded.graph.factor_count() > 0) return;
  throw Error(
      ErrorCode::input,
      fmt::format("{}: has no factors and so no covariance; --kld compares two graphs, such "
                  "as cairn optimize and cairn sparsify write",
                  loaded.label));
}

/// The ids of the estimate that the truth has, too. Throws `Error` (input) where a variable is of
/// another type there.
std::vector<Id> common_ids(const Graph& estimate, const Graph& truth) {
  std::vector<Id> ids;
  for (int v = 0; v < estimate.variable_count(); ++v) {
    const std::optional<int> there = truth.find(estimate.id(v));
    if (!there) continue;
    if (truth.type(*there).tag() != estimate.type(v).tag()) {
      throw Error(
          ErrorCode::input,
          fmt::format("--kld compares the same variables, but {} of ESTIMATE is {} in TRUTH",
                      estimate.describe_variable(v), truth.describe_variable(*there)));
    }
    ids.push_back(estimate.id(v));
  }
  return ids;
}

GraphDivergence divergence_of(const Graph& truth, const Graph& estimate,
                              const std::vector<Id>& common, const EvaluateOptions& options,
                              CovarianceSolver& solver) {
  const ComparedAt at = options.compared_at == "minima" ? ComparedAt::minima : ComparedAt::common;
  GraphDivergence result;
  result.variables = common.size();
  result.error =
      call_plugin([&] { return fmt::format("linear solver '{}'", solver.name); },
                  [&] {
                    return std::ssize(common) == estimate.variable_count()
                               ? sparsification_error(truth, estimate, *solver.solver, at)
                               : marginal_divergence(truth, estimate, common, *solver.solver, at);
                  });
  return result;
}

// Results -----------------------------------------------------------------------------------------

/// What is written of a comparison.
struct Evaluation {
  const TrajectoryError& error;
  const TrajectoryPairs& pairs;
  const GraphDivergence& divergence;

  static ResultFields<Evaluation> fields() {
    using E = Evaluation;
    return ResultFields<E>()
        .part([](const E& e) { return e.error; })
        .without("poses")
        .figure(
            "poses.compared", [](const E& e) { return e.error.poses; }, "how many were compared")
        .figure(
            "poses.only_in_estimate", [](const E& e) { return e.pairs.only_in_estimate; },
            "without a partner")
        .figure(
            "poses.only_in_truth", [](const E& e) { return e.pairs.only_in_truth; },
            "without a partner")
        .details()
        .part([](const E& e) { return e.divergence.error; })
        .optional()
        .without("rmse")
        .without("rmse_aligned");
  }
};

Table divergence_table(const GraphDivergence& divergence, const EvaluateOptions& options) {
  Table table({{fmt::format("KLD of {}, at the states of {}",
                            plural(static_cast<std::int64_t>(divergence.variables), "variable"),
                            options.compared_at == "minima" ? "each" : "TRUTH"),
                Table::Align::left},
               {"nats", Table::Align::right}});
  if (!divergence.error) return table;
  const Figures figures(*divergence.error, kDigits);
  table.add({"divergence", figures.number("kld")});
  table.add({"of this, covariances", figures.number("kld_parts.covariance")});
  table.add({"and means", figures.number("kld_parts.mean")});
  return table;
}

Table error_table(const TrajectoryError& error, const EvaluateOptions& options,
                  const std::string& pairing) {
  Table table(
      {{fmt::format("{} compared{}", plural(error.poses, "pose"), pairing), Table::Align::left},
       {"translation [m]", Table::Align::right},
       {"rotation [deg]", Table::Align::right}});
  const Figures figures(error);
  const auto row = [&](const char* title, const std::string& name) {
    table.add({title, figures.number(name + ".translation"), figures.number(name + ".rotation")});
  };
  row(options.scale ? "ATE (absolute, after alignment with scale)"
                    : "ATE (absolute, after rigid alignment)",
      "ate");
  row("RPE (consecutive poses)", "rpe");
  row("RPE all to all (every pair)", "rpe_all");
  if (options.scale) table.add({"scale of the estimate", figures["scale"], ""});
  figures.add_rows(table);
  return table;
}

json::object association_json(const EvaluateOptions& options, const Pairing& pairing) {
  if (!pairing.by_stamp) return {{"by", "id"}, {"row_numbers", pairing.rows != RowPairing::none}};
  const StampMatching matching = options.matching();
  return {{"by", "stamp"},
          {"offset", matching.offset},
          {"max_time_difference", matching.max_difference},
          {"largest_time_difference", pairing.pairs.largest_difference}};
}

json::object report_json(const EvaluateOptions& options, const Pairing& pairing,
                         const Evaluation& evaluation) {
  json::object report = begin_report("evaluate");
  report["estimate"] = options.estimate.file;
  report["truth"] = options.truth.file;
  report["association"] = association_json(options, pairing);
  report["axes"] = {{"estimate", options.estimate.axes}, {"truth", options.truth.axes}};
  report["planar"] = options.planar;
  report["alignment"] = options.scale ? "similarity" : "rigid";
  if (options.kld) report["kld"] = nullptr;  // where it could not be computed
  put(report, evaluation);
  if (evaluation.divergence.error) {
    report["kld_of"] = {{"variables", evaluation.divergence.variables},
                        {"compared_at", options.compared_at},
                        {"linear_solver", options.linear_solver}};
  }
  return report;
}

// The command -------------------------------------------------------------------------------------

int run(const EvaluateOptions& options, Session& session) {
  session.use_threads();
  check_file(options.csv, session);
  check_file(options.latex, session);
  std::optional<CovarianceSolver> solver;  // a wrong name is reported before a file is read
  if (options.kld) {
    solver = make_determinant_solver(options.linear_solver, session.registry(), true);
    if (const std::string reason = option_about_stamps(options); !reason.empty()) {
      throw Error(ErrorCode::usage,
                  fmt::format("--kld compares variables by id; leave out {}", reason));
    }
  }
  const LoadedGraph estimate_graph = load_graph(options.estimate.file, options.input, session);
  const LoadedGraph truth_graph =
      load_ground_truth(options.truth.file, options.input, session, options.kld);
  std::vector<Id> common;
  if (options.kld) {
    need_factors(estimate_graph);
    need_factors(truth_graph);
    common = common_ids(estimate_graph.graph, truth_graph.graph);
  }
  const Trajectory estimate = trajectory_of(estimate_graph, options.estimate, options, session);
  const Trajectory truth = trajectory_of(truth_graph, options.truth, options, session);
  const Pairing pairing = pair(estimate, truth, estimate_graph, truth_graph, options, session);
  const TrajectoryPairs& pairs = pairing.pairs;
  const TrajectoryError error =
      compare(pairs, options.scale ? Alignment::similarity : Alignment::rigid);
  warn_of_missing(pairs.only_in_estimate, options.estimate.file, options.truth.file,
                  pairing.by_stamp, session);
  warn_of_missing(pairs.only_in_truth, options.truth.file, options.estimate.file, pairing.by_stamp,
                  session);
  suggest_scale(pairs, options, error, session);
  suggest_axes(pairs, options, error, session);
  suggest_order(pairs, options, estimate_graph, truth_graph, error, session);
  warn_of_dimensions(estimate_graph, truth_graph, estimate, truth, session);
  Results results;
  GraphDivergence divergence;
  if (solver) {
    results.add([&] {
      divergence = divergence_of(truth_graph.graph, estimate_graph.graph, common, options, *solver);
    });
  }
  results.add([&] {
    session.write_json(report_json(options, pairing, {error, pairs, divergence}));
  });
  const Table errors = error_table(error, options, pairing.text),
              nats = divergence_table(divergence, options);
  results.write(options.csv, [&] {
    write_file(options.csv, Figures(Evaluation{error, pairs, divergence}).csv());
  });
  results.write(options.latex, [&] {
    write_file(options.latex, errors.latex() + (nats.empty() ? "" : "\n" + nats.latex()));
  });
  results.add([&] {
    session.print(errors.text(session.colour()) +
                  (nats.empty() ? "" : "\n" + nats.text(session.colour())));
  });
  results.finish();
  return 0;
}

}  // namespace

void add_evaluate(Registrar& registrar) {
  add_command<EvaluateOptions>(
      registrar, "evaluate",
      "Root mean squares: ATE after the rigid motion that brings ESTIMATE nearest to TRUTH, RPE "
      "between\n"
      "consecutive poses, RPE all to all over every pair; translation in metres, rotation in "
      "degrees. With\n"
      "--align-scale the positions of ESTIMATE are scaled before all of them.\n\n"
      "Example:\n"
      "  cairn evaluate best.g2o truth.g2o --json errors.json\n"
      "  cairn evaluate slam.tum poses.txt --truth-stamps times.txt --truth-axes camera\n"
      "  cairn evaluate camera.tum euroc.csv --align-scale\n"
      "  cairn evaluate sparse.g2o best.g2o --kld",
      run);
}

}  // namespace cairn::app
