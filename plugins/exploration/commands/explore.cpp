// SPDX-License-Identifier: BSD-3-Clause
// cairn explore FLOOR: a robot that explores a floor.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/exploration/explorer_comparison.hpp"
#include "cairn/exploration/recorded_world.hpp"
#include "cairn/exploration/scan_log.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/io/format_by_ending.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/progress.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "explore_comparison.hpp"
#include "explore_recording.hpp"
#include "explore_report.hpp"
#include "explore_words.hpp"
#include "floor_drawing.hpp"
#include "floors.hpp"
#include "slam_names.hpp"

namespace cairn::app {
namespace {

using Clock = std::chrono::steady_clock;

struct ExploreOptions {
  std::string floor;
  std::string world = ExplorationSetup::kWorld, lidar, odometry;
  SlamNames slam{.policy = ExplorationSetup::kPolicy};
  std::string explorer = ExplorationSetup::kExplorer;
  std::string until, match;
  std::optional<double> decision_budget;  // [s]
  ComparisonOptions comparison;
  std::uint64_t seed = 1;
  bool no_consecutive = false;
  std::optional<double> start_x, start_y, start_theta;
  std::string output, trajectory, truth, map, steps, log, loss;
  RunRecordingOptions recording;
  bool live = false;

  double most_of_a_decision() const {  // [s]
    return decision_budget.value_or(std::numeric_limits<double>::infinity());
  }

  static auto fields() {
    using O = ExploreOptions;
    constexpr double kAny = std::numeric_limits<double>::infinity();
    return OptionFields<O>()
        .text("floor", &O::floor, "the floor: floor.yaml, or @KIND[:k=v] to generate")
        .positional()
        .placeholder("FLOOR")
        .or_generated_by({"floor_plan"})
        .text("output", &O::output, "write the graph of the poses that are kept")
        .letter('o')
        .placeholder("OUT")
        .text("map", &O::map, "write the map that was built")
        .placeholder("FILE")
        .text("trajectory", &O::trajectory, "write all poses, those left out put back")
        .placeholder("FILE")
        .text("truth", &O::truth, "write where the robot truly was")
        .placeholder("FILE")
        .text("steps", &O::steps, "a row for each motion, as CSV")
        .placeholder("FILE")
        .text("log", &O::log, "write scans, odometry and true poses as a log of CARMEN, run.clf.gz")
        .placeholder("FILE")
        .part(&O::recording)
        .components("explorer", &O::explorer, {"explorer"},
                    "decides where to drive; options as NAME:k=v; several, A,B, are compared; "
                    "frontier finishes small floors sooner")
        .text("until", &O::until,
              "limits: distance=250 [m], steps=N, decisions=N, known=0.99 of what the body can "
              "cover, rate=0.5 [m²/m] that the last 20 m brought")
        .placeholder("K=V,…")
        .part(&O::comparison)
        .real("decision_budget", &O::decision_budget, 1e-3, kAny,
              "within which explorers decide [s], as far as they can: then no run is like the "
              "other")
        .placeholder("S")
        .text("match", &O::match,
              "loop closures as explorers expect them: range=1,angle=0.35,sigma_xy=0.05")
        .placeholder("K=V,…")
        .boolean("no_consecutive", &O::no_consecutive,
                 "match no scan with the one before: odometry alone leads from one to the next")
        .text("lidar", &O::lidar, "options of the lidar: fov=180,range=8,beams=181")
        .placeholder("K=V,…")
        .text("odometry", &O::odometry, "its noise: relative=0.15,sigma_xy=0.01")
        .placeholder("K=V,…")
        .real("start_x", &O::start_x, -kAny, kAny,
              "where the robot starts [m]; default: the widest place")
        .placeholder("M")
        .real("start_y", &O::start_y, -kAny, kAny, "goes with --start-x")
        .placeholder("M")
        .real("start_theta", &O::start_theta, -kAny, kAny,
              "its heading there [rad]; default: 0; without --start-x by the seed")
        .placeholder("RAD")
        .integer("seed", &O::seed, 0, kMostSeed, "of all noise and random choices")
        .component("world", &O::world, {"world"},
                   "the robot; its options: cairn plugins lidar_building, motion=holonomic or "
                   "motion=dubins for instance; log:file=robot.clf is one that was recorded, and "
                   "goes where it went, without a FLOOR")
        .component("loss", &O::loss, {"loss"},
                   "robust loss of loop closures, or none [none; of a recorded robot "
                   "cauchy:scale=2]")
        .part(&O::slam)
        .boolean("live", &O::live, "draw map, trajectory and path in the terminal on the way");
  }
};

/// "range=8,fov=180" among the options of a component.
void merge(const std::string& words, const char* option, ComponentSpec& spec) {
  if (words.empty()) return;
  for (const auto& [key, value] : parse_component(fmt::format("{}:{}", spec.name, words)).values) {
    if (!spec.values.emplace(key, value).second)
      throw Error(
          ErrorCode::usage,
          fmt::format("{}: '{}' is among the options of --world too: give one", option, key));
  }
}

ComponentSpec world_spec(const ExploreOptions& options) {
  ComponentSpec spec = parse_component(options.world);
  check_part_words(options.lidar, "--lidar");
  check_part_words(options.odometry, "--odometry");
  merge(options.lidar, "--lidar", spec);
  merge(options.odometry, "--odometry", spec);
  return spec;
}

std::optional<Pose2> start_of(const ExploreOptions& options) {
  if (options.start_x.has_value() != options.start_y.has_value())
    throw Error(ErrorCode::usage, "--start-x and --start-y go together");
  if (!options.start_x) {
    if (options.start_theta)
      throw Error(ErrorCode::usage, "--start-theta needs --start-x and --start-y");
    return std::nullopt;
  }
  return Pose2(*options.start_x, *options.start_y, options.start_theta.value_or(0.0));
}

std::vector<Eigen::Vector2d> positions(const std::vector<ExplorationStep>& steps) {
  std::vector<Eigen::Vector2d> points;
  for (const ExplorationStep& step : steps) points.emplace_back(step.estimate.translation());
  return points;
}

/// Shows the run on standard error while it goes on: a line, or with --live a drawing.
class ExploreProgress {
 public:
  ExploreProgress(const ExploreOptions& options, const Session& session)
      : options_(options),
        line_(session.common.quiet),
        live_(options.live && line_.on_terminal()),
        colour_(use_colour(stderr)) {
    if (options.live && !live_) session.note("--live: standard error is not a terminal");
  }

  void decided(const Decision& decision) {
    path_.clear();
    if (decision.kind == Decision::Kind::drive)
      path_ = decision.candidates.at(decision.chosen).path.points;
    why_ = decision.why;
  }

  void moved(const ExplorationStep& step, const FloorMap& map) {
    trajectory_.emplace_back(step.estimate.translation());
    const auto now = Clock::now();
    const auto pause = live_ ? 100 : line_.on_terminal() ? 50 : 5000;
    if (now - shown_ < std::chrono::milliseconds(pause)) return;
    shown_ = now;
    if (live_) return draw(step, map);
    line_.show(fmt::format("{} {:.1f} m driven, {:.1f} m² known, {}: {}", options_.explorer,
                           step.distance, step.coverage, plural(step.loops, "loop closure"), why_));
  }

  void clear() { line_.clear(); }

 private:
  void draw(const ExplorationStep& step, const FloorMap& map) {
    const std::size_t width = terminal_width(stderr);
    const std::string drawing = floor_text({.map = map,
                                            .trajectory = trajectory_,
                                            .robot = step.estimate.translation(),
                                            .path = path_},
                                           width, 2 * width / 5, colour_);
    // Over the drawing before: home, and what is left below is wiped.
    fmt::print(stderr, "\x1b[H{}\x1b[J{:.1f} m driven, {:.1f} m² known, {}\n{}\n", drawing,
               step.distance, step.coverage, plural(step.loops, "loop closure"),
               shortened(why_, width));
  }

  const ExploreOptions& options_;
  StatusLine line_;
  bool live_, colour_;
  std::vector<Eigen::Vector2d> trajectory_, path_;
  std::string why_;
  Clock::time_point shown_ = Clock::now();
};

bool compares(const ExploreOptions& options) {
  return options.comparison.asked_for(split_components(options.explorer));
}

/// What belongs to one run alone.
void check_single(const ExploreOptions& options) {
  const std::pair<const char*, bool> single[]{{"--output", !options.output.empty()},
                                              {"--trajectory", !options.trajectory.empty()},
                                              {"--truth", !options.truth.empty()},
                                              {"--map", !options.map.empty()},
                                              {"--steps", !options.steps.empty()},
                                              {"--log", !options.log.empty()},
                                              {"--record", !options.recording.record.empty()},
                                              {"--serve", options.recording.port.has_value()},
                                              {"--live", options.live}};
  for (const auto& [option, given] : single) {
    if (given) {
      throw Error(ErrorCode::usage,
                  fmt::format("{} is of one run: it goes with one explorer, and without --runs, "
                              "--csv, --curves and --latex",
                              option));
    }
  }
}

void check(const ExploreOptions& options, Session& session) {
  check_world(parse_component(options.world).name, session.registry());
  if (compares(options)) {
    check_single(options);
    return check_comparison(options.comparison, options.recording.page, session);
  }
  if (!options.map.empty()) check_map_file(options.map, "--map", session);
  for (const std::string& graph : {options.output, options.trajectory, options.truth})
    check_output(graph, "", session, false);
  check_file(options.steps, session);
  const ComponentSpec world = world_spec(options);
  if (const auto recording = world.values.find("file"); recording != world.values.end())
    session.files.add_input(parse_named_file(recording->second).file.string());
  if (!options.log.empty()) {
    check_scan_log_name(options.log, session.registry());
    check_file(parse_named_file(options.log).file.string(), session);
  }
  check_recording(options.recording, session);
}

RecordedRun recorded_run(const ExploreOptions& options, const ExploreParts& parts,
                         const World& world) {
  return {.name = options.explorer,
          .floor = options.floor,
          .parts = {{"world", parts.world},
                    {"policy", parts.policy},
                    {"registration", parts.registration},
                    {"mapper", parts.mapper},
                    {"explorer", parts.explorer}},
          .seed = parts.seed,
          .robot = world.robot()};
}

void write_outputs(const ExploreOptions& options, const ExploreOutcome& outcome, Results& results,
                   Session& session) {
  const ExplorationResult& result = outcome.result;
  Registry& registry = session.registry();
  const auto write = [&](const Graph& graph, const std::string& file) {
    results.write(file, [&] { write_graph(graph, file, registry, output_format(file, "")); });
  };
  write(result.graph, options.output);
  write(result.trajectory, options.trajectory);
  write(result.truth_trajectory, options.truth);
  results.write(options.map, [&] { write_grid(result.map.occupancy(), options.map, registry); });
  results.write(options.steps, [&] { write_file(options.steps, steps_csv(result)); });
  results.write(options.log, [&] { write_scan_log(outcome.log, options.log, registry); });
  results.add([&] { session.write_json(report_json(outcome)); });
  results.add([&] {
    const auto points = positions(result.steps);
    print_floor({.map = result.map, .trajectory = points, .robot = points.back()}, session);
    session.print(summary_text(outcome));
  });
}

/// Matches of scans of a real floor may be wrong.
constexpr const char* kLossOfRecordings = "cauchy:scale=2";
constexpr const char* kNoLoss = "none";

/// The parts as they were named, and the loss as it is without a name.
ExploreParts parts_of(const ExploreOptions& options, bool is_recorded) {
  return {.world = spec_text(world_spec(options)),
          .policy = options.slam.policy,
          .registration = options.slam.registration,
          .mapper = options.slam.mapper,
          .explorer = options.explorer,
          .loss = !options.loss.empty() ? options.loss
                  : is_recorded         ? kLossOfRecordings
                                        : kNoLoss,
          .seed = options.seed};
}

/// A floor, and what a robot can cover of it.
struct ExploredFloor {
  OccupancyGrid grid;
  std::vector<std::uint8_t> reachable;
};

/// The floor to drive on; none: a recorded robot has driven already.
std::optional<ExploredFloor> floor_of(const ExploreOptions& options, const World& world,
                                      bool is_recorded, Session& session) {
  if (options.floor.empty()) {
    if (is_recorded) return std::nullopt;
    throw Error(
        ErrorCode::usage,
        "FLOOR is missing: name the map of a floor, floor.yaml, or @KIND of a generated one, "
        "such as @rooms; --world log alone needs none");
  }
  ExploredFloor floor{.grid = load_floor(options.floor, session), .reachable = {}};
  if (!is_recorded)
    floor.reachable = note_narrow_ways(options.floor, floor.grid, world.robot().radius,
                                       start_of(options), session);
  return floor;
}

std::shared_ptr<const Loss> loop_loss(const std::string& name, Registry& registry) {
  return name == kNoLoss ? nullptr : registry.make<Loss>(name);
}

int compare_explorers(const ExploreOptions& options, Session& session) {
  Registry& registry = session.registry();
  const ComponentSpec world = world_spec(options);
  // What is wrong with its options is reported before the work.
  const auto one_world = registry.make<World>(world);
  if (query<RecordedWorld>(*one_world)) {
    throw Error(ErrorCode::usage,
                fmt::format("--world: a robot of '{}' goes where it went, whatever an explorer "
                            "decides: there is nothing to compare",
                            world.name));
  }
  const MatchModel match = match_of(options.match);
  const ExplorationLimits limits = limits_of(options.until);
  const std::optional<Pose2> start = start_of(options);
  const ExploreParts parts = parts_of(options, false);
  const std::shared_ptr<const Loss> loss = loop_loss(parts.loss, registry);
  const ExploredFloor floor = *floor_of(options, *one_world, false, session);
  const ExplorationSetup setup{.registry = registry,
                               .world = world,
                               .policy = parse_component(options.slam.policy),
                               .registration = parse_component(options.slam.registration),
                               .mapper = parse_component(options.slam.mapper),
                               .floor = floor.grid,
                               .reachable = floor.reachable,
                               .start = start,
                               .limits = limits,
                               .match = match,
                               .decision_budget = options.most_of_a_decision(),
                               .loop_loss = loss,
                               .match_consecutive = !options.no_consecutive};
  return run_comparison(options.comparison, options.recording.page, setup, options.floor, parts,
                        session);
}

int run_explore(const ExploreOptions& options, Session& session) {
  check(options, session);
  session.use_threads();
  if (options.decision_budget)
    session.note("with --decision-budget the clock decides: this run can't be repeated exactly");
  if (compares(options)) return compare_explorers(options, session);
  Registry& registry = session.registry();
  const ExplorationLimits limits = limits_of(options.until);
  const MatchModel match = match_of(options.match);
  const std::optional<Pose2> start = start_of(options);
  const ComponentSpec world_name = world_spec(options);
  const auto seeded = [&](std::string_view kind, const std::string& name) {
    return with_seed(registry, kind, parse_component(name), options.seed);
  };
  const auto world = registry.make<World>(world_name);
  if (!options.log.empty()) check_scan_log(world->robot().lidar, options.log, registry);
  const auto policy = registry.make<PosePolicy>(seeded(PosePolicy::kKind, options.slam.policy));
  const auto registration =
      registry.make<Registration>(seeded(Registration::kKind, options.slam.registration));
  const auto mapper = registry.make<Mapper>(parse_component(options.slam.mapper));
  const auto explorer = registry.make<Explorer>(parse_component(options.explorer));
  const bool is_recorded = query<RecordedWorld>(*world) != nullptr;
  const ExploreParts parts = parts_of(options, is_recorded);
  const std::shared_ptr<const Loss> loss = loop_loss(parts.loss, registry);
  const std::optional<ExploredFloor> floor = floor_of(options, *world, is_recorded, session);
  ScanLog log;
  const InterruptGuard guard;  // until the results are written
  ExploreProgress progress(options, session);
  RunRecording recording(options.recording, recorded_run(options, parts, *world), session);
  Exploration exploration{
      .world = *world,
      .policy = *policy,
      .registration = *registration,
      .mapper = *mapper,
      .explorer = *explorer,
      .registry = registry,
      .start = {.floor = floor ? &floor->grid : nullptr, .pose = start, .seed = options.seed},
      .limits = limits,
      .match = match,
      .decision_budget = options.most_of_a_decision(),
      .sample_distance = ExplorationSetup::kSampleDistance,
      .interrupt = &guard.flag(),
      .decided = [&](const Decision& decision, const Situation&) { progress.decided(decision); },
      .moved = [&](const ExplorationStep& step, const FloorMap& map) { progress.moved(step, map); },
      .match_consecutive = !options.no_consecutive,
      .loop_loss = loss,
      .log = options.log.empty() ? nullptr : &log};
  if (floor) exploration.reachable = floor->reachable;
  recording.follow(exploration);
  ExploreOutcome outcome{.floor = options.floor,
                         .frame = {},
                         .parts = parts,
                         .repeatable = !options.decision_budget,
                         .result = run_exploration(exploration),
                         .log = std::move(log)};
  outcome.frame = floor ? floor->grid.frame : outcome.result.map.frame;
  progress.clear();
  for (const std::string& note : outcome.result.notes) session.note(note);
  Results results;
  recording.write(outcome.result, results, session);
  write_outputs(options, outcome, results, session);
  results.finish();
  if (guard.interrupted()) return kExitInterrupted;
  if (outcome.result.converged) return 0;
  session.note("the estimate has not converged");
  return static_cast<int>(ErrorCode::numerical);
}

}  // namespace

void add_explore(Registrar& registrar) {
  add_command<ExploreOptions>(
      registrar, "explore",
      "Example:\n"
      "  cairn explore @rooms:seed=3\n"
      "  cairn explore floor.yaml --until distance=250 --odometry relative=0.15 -o run.g2o --map "
      "map.yaml\n"
      "  cairn explore floor.yaml --record run.jsonl && cairn view run.jsonl -o run.html\n"
      "  cairn explore --world log:file=robot.clf.gz --record run.jsonl --map map.yaml\n"
      "  cairn explore floor.yaml --explorer frontier,random --runs 20 --csv runs.csv --html "
      "compare.html",
      run_explore);
}

}  // namespace cairn::app
