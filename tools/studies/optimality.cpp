// SPDX-License-Identifier: BSD-3-Clause

#include <atomic>
#include <cstdint>
#include <ctime>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <boost/json/array.hpp>
#include <boost/json/object.hpp>

#include "cairn/evaluation/mean_interval.hpp"
#include "cairn/exploration/exploration.hpp"
#include "cairn/exploration/random_stream.hpp"
#include "cairn/planning/path_motions.hpp"
#include "cairn/planning/path_optimality.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/session.hpp"
#include "cairn/program/table.hpp"
#include "drives.hpp"
#include "random_paths.hpp"
#include "rank_correlation.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

struct OptimalityStudyOptions {
  DriveOptions drives{
      .slam = {.policy = "compact_pose:strategy=apfl,range=2,angle=3.14,reuse=false,gate=0.9999"}};
  std::string solver = "block_cholesky";
  int poses = 1000, paths = 1000;
  double loop_gain = PathOptimalityOptions{}.loop_gain;

  static auto fields() {
    using O = OptimalityStudyOptions;
    return OptionFields<O>()
        .part(&O::drives)
        .integer("poses", &O::poses, 2, 1e6, "of the graph at which paths are compared")
        .integer("paths", &O::paths, 2, 1e6, "to random places on the known floor")
        .real("loop_gain", &O::loop_gain, -1.0, 1e9,
              "information that a loop closure on a path must exceed [nats]; negative: that of the "
              "policy")
        .component("linear_solver", &O::solver, {"linear_solver"},
                   "factorises the matrix of the graph");
  }
};

/// Adds the processor time from here to the end of the scope, which other work on the machine does
/// not lengthen [s].
class ProcessorTimed {
 public:
  explicit ProcessorTimed(double& seconds) : seconds_(seconds), begin_(std::clock()) {}
  ProcessorTimed(const ProcessorTimed&) = delete;
  ProcessorTimed& operator=(const ProcessorTimed&) = delete;
  ~ProcessorTimed() { seconds_ += static_cast<double>(std::clock() - begin_) / CLOCKS_PER_SEC; }

 private:
  double& seconds_;
  std::clock_t begin_;
};

/// What one form of the criterion has of the paths of a set.
struct Evaluated {
  double prepare = 0.0, seconds = 0.0;  ///< once, and for all paths: of the processor [s]
  double loops = 0.0;                   ///< mean per path
  std::vector<double> values;           ///< ln D-opt
};

/// The paths that were compared at the end of one run.
struct Comparison {
  int poses = 0, paths = 0;
  double motions = 0.0;  ///< mean per path
  Evaluated exact, laplacian;
  double tau = 0.0;
};

Evaluated evaluate(const Situation& situation, OptimalityForm by, double loop_gain,
                   LinearSolver& solver, const std::vector<std::vector<Pose2>>& paths) {
  Evaluated result;
  std::unique_ptr<PathOptimalities> optimalities;
  {
    const ProcessorTimed timed(result.prepare);
    optimalities = std::make_unique<PathOptimalities>(
        situation, PathOptimalityOptions{.by = by, .loop_gain = loop_gain}, solver);
  }
  const ProcessorTimed timed(result.seconds);
  for (const std::vector<Pose2>& motions : paths) {
    const PathOptimality path = optimalities->along(motions);
    result.values.push_back(path.log_optimality);
    result.loops += static_cast<double>(path.loops) / static_cast<double>(paths.size());
  }
  return result;
}

class Study {
 public:
  Study(const OptimalityStudyOptions& options, Session& session)
      : options_(options), drives_(options.drives, session) {}

  std::vector<Comparison> run() {
    drives_.each([this](std::uint64_t seed) { explore(seed); });
    return std::move(comparisons_);
  }
  bool interrupted() const { return drives_.interrupted(); }

 private:
  /// Until the graph has as many poses as wanted, or nothing is left to explore.
  void explore(std::uint64_t seed) {
    StudyDrives::Parts parts = drives_.parts();
    std::atomic<bool> stop{false};
    Exploration exploration = drives_.exploration(parts, seed);
    exploration.interrupt = &stop;
    exploration.scanned = [&](const ExplorationStep&, const Situation& situation,
                              const LaserScan&) {
      const auto poses = static_cast<int>(situation.poses.size());
      if (drives_.line().on_terminal())
        drives_.line().show(fmt::format("seed {}: {} poses", seed, poses));
      if (stop) return;
      stop = interrupted() || poses >= options_.poses;
      if (poses >= options_.poses) compare(situation, seed);
    };
    run_exploration(exploration);
    if (!stop) {
      drives_.session().note(fmt::format(
          "seed {}: the floor was explored before the graph had {} poses", seed, options_.poses));
    }
  }

  void compare(const Situation& situation, std::uint64_t seed) {
    const auto planner = drives_.make<PathPlanner>(options_.drives.planner);
    RandomStream random(seed, RandomStream::Purpose::explorer);
    std::vector<std::vector<Pose2>> paths;
    Comparison comparison;
    comparison.poses = static_cast<int>(situation.poses.size());
    for (const PlannedPath& path : random_paths(situation, *planner, options_.paths, random)) {
      paths.push_back(motions_along(situation.pose, path, situation.robot));
      comparison.motions += static_cast<double>(paths.back().size());
    }
    if (paths.size() < 2) return;
    comparison.paths = static_cast<int>(paths.size());
    comparison.motions /= static_cast<double>(paths.size());
    for (const OptimalityForm by : {OptimalityForm::exact, OptimalityForm::laplacian}) {
      const auto solver = drives_.make<LinearSolver>(options_.solver);
      (by == OptimalityForm::exact ? comparison.exact : comparison.laplacian) =
          evaluate(situation, by, options_.loop_gain, *solver, paths);
    }
    comparison.tau = kendall_tau(comparison.exact.values, comparison.laplacian.values);
    comparisons_.push_back(std::move(comparison));
  }

  const OptimalityStudyOptions& options_;
  StudyDrives drives_;
  std::vector<Comparison> comparisons_;
};

json::object evaluated_json(const Evaluated& of) {
  return {{"prepare_seconds", of.prepare}, {"seconds", of.seconds}, {"loops", of.loops}};
}

int run_study(const OptimalityStudyOptions& options, Session& session) {
  session.use_threads();
  Study study(options, session);
  const std::vector<Comparison> comparisons = study.run();
  Table table({{"poses", Table::Align::right},
               {"paths", Table::Align::right},
               {"motions", Table::Align::right},
               {"loops", Table::Align::right},
               {"exact [s]", Table::Align::right},
               {"Laplacian: loops", Table::Align::right},
               {"[s]", Table::Align::right},
               {"τ", Table::Align::right}});
  std::vector<double> taus;
  json::array rows;
  const auto times = [](const Evaluated& of) {
    return fmt::format("{:.3f} + {:.3f}", of.prepare, of.seconds);
  };
  for (const Comparison& of : comparisons) {
    taus.push_back(of.tau);
    rows.push_back({{"poses", of.poses},
                    {"paths", of.paths},
                    {"motions", of.motions},
                    {"exact", evaluated_json(of.exact)},
                    {"laplacian", evaluated_json(of.laplacian)},
                    {"tau", number_json(of.tau)}});
    table.add({fmt::format("{}", of.poses), fmt::format("{}", of.paths),
               fmt::format("{:.1f}", of.motions), fmt::format("{:.2f}", of.exact.loops),
               times(of.exact), fmt::format("{:.2f}", of.laplacian.loops), times(of.laplacian),
               fmt::format("{:.3f}", of.tau)});
  }
  const MeanInterval tau = mean_interval(taus);
  json::object report = begin_report("study");
  report["floor"] = options.drives.floor;
  report["sets"] = std::move(rows);
  report["tau"] = {{"mean", number_json(tau.mean)},
                   {"low", number_json(tau.low())},
                   {"high", number_json(tau.high())}};
  report["status"] = study.interrupted() ? "interrupted" : "finished";
  end_report(report);
  Results results;
  results.add([&] { session.write_json(report); });
  results.add([&] {
    session.print(table.text(session.colour()));
    session.print(
        fmt::format("τ of exact D-optimality and that of the Laplacian: {}; processor time: once, "
                    "and for all paths; loops and motions per path\n",
                    interval_text(tau)));
  });
  results.finish();
  return study.interrupted() ? kExitInterrupted : 0;
}

}  // namespace

void add_study_optimality(Registrar& registrar) {
  add_command<OptimalityStudyOptions>(registrar, "study optimality",
                                      "Example:\n"
                                      "  cairn study optimality @rooms --poses 200 --paths 100",
                                      run_study);
}

}  // namespace cairn::app
