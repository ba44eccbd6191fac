// SPDX-License-Identifier: BSD-3-Clause

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <Eigen/LU>

#include "cairn/evaluation/mean_interval.hpp"
#include "cairn/exploration/exploration.hpp"
#include "cairn/exploration/random_stream.hpp"
#include "cairn/io/format.hpp"
#include "cairn/planning/joint_objective.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/session.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "drives.hpp"
#include "path_sampler.hpp"
#include "random_paths.hpp"
#include "rank_correlation.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

struct ObjectiveStudyOptions {
  DriveOptions drives{
      .slam = {.policy = "compact_pose:range=2,angle=3.14,reuse=false,gate=0.9999"}};
  double distance = 60.0, range = 4.0;
  int decisions = 4, candidates = 12, samples = 200;
  std::string paths;

  static auto fields() {
    using O = ObjectiveStudyOptions;
    return OptionFields<O>()
        .part(&O::drives)
        .real("distance", &O::distance, 1.0, 1e6, "that each drives [m]")
        .placeholder("M")
        .integer("decisions", &O::decisions, 1, 1e6, "per run at which paths are compared, at most")
        .integer("candidates", &O::candidates, 2, 1e6, "paths to random places at each of these")
        .integer("samples", &O::samples, 2, 1e6, "of the trajectory, for each path")
        .real("range", &O::range, 0.1, 1000.0, "of the scans that are expected on a path [m]")
        .placeholder("M")
        .text("paths", &O::paths, "a row for each path that was sampled, as CSV")
        .placeholder("FILE");
  }
};

/// A form of the objective, as options of `JointObjective`.
struct Form {
  std::string name;
  JointObjectiveOptions options;
};

std::vector<Form> forms() {
  constexpr double kThird = 1.0 / 3.0;
  std::vector<Form> all{{"alpha=none", {.alpha = AlphaForm::none}}};
  for (const AlphaForm alpha : {AlphaForm::end, AlphaForm::now, AlphaForm::both}) {
    for (const double reference : {0.0, 1.0}) {
      for (const double power : {1.0, kThird}) {
        const std::string name =
            fmt::format("alpha={},reference={},power={}", to_string(alpha),
                        reference == 0.0 ? "cell" : "1", power == 1.0 ? "1" : "1/3");
        all.push_back({name, {.alpha = alpha, .reference = reference, .power = power}});
      }
    }
  }
  return all;
}

/// Hands all on to a mapper, and keeps what it was given.
class RecordingMapper final : public Mapper {
 public:
  explicit RecordingMapper(std::unique_ptr<Mapper> mapper) : mapper_(std::move(mapper)) {}

  void add(const Pose2& at, LaserScan scan) override {
    poses_.push_back(at);
    scans_.push_back(scan);
    mapper_->add(at, std::move(scan));
  }
  bool move(std::span<const Pose2> poses) override {
    poses_.assign(poses.begin(), poses.end());
    return mapper_->move(poses);
  }
  const FloorMap& map() override { return mapper_->map(); }
  void reset() override {
    poses_.clear();
    scans_.clear();
    mapper_->reset();
  }

  std::span<const Pose2> poses() const { return poses_; }
  std::span<const LaserScan> scans() const { return scans_; }

 private:
  std::unique_ptr<Mapper> mapper_;
  std::vector<Pose2> poses_;
  std::vector<LaserScan> scans_;
};

/// The paths that were compared at one decision.
struct PathSet {
  std::uint64_t seed = 0;
  int decision = 0;
  double map_entropy = 0.0, resolution = 0.0, lidar_range = 0.0;
  std::vector<SampledPath> paths;
};

class Study {
 public:
  Study(const ObjectiveStudyOptions& options, Session& session)
      : options_(options), drives_(options.drives, session) {}

  std::vector<PathSet> run() {
    drives_.each([this](std::uint64_t seed) { explore(seed); });
    return std::move(sets_);
  }
  bool interrupted() const { return drives_.interrupted(); }

 private:
  void explore(std::uint64_t seed) {
    StudyDrives::Parts parts = drives_.parts();
    auto recording = std::make_unique<RecordingMapper>(std::move(parts.mapper));
    const RecordingMapper& recorder = *recording;
    parts.mapper = std::move(recording);
    RandomStream random(seed, RandomStream::Purpose::explorer);
    double next = 0.0, driven = 0.0;
    const double apart = options_.distance / options_.decisions;
    Exploration exploration = drives_.exploration(parts, seed);
    exploration.limits.distance = options_.distance;
    exploration.decided = [&](const Decision&, const Situation& situation) {
      if (driven < next || situation.poses.size() < 2) return;
      next = driven + apart;
      compare(situation, recorder, seed, random);
    };
    exploration.moved = [&](const ExplorationStep& step, const FloorMap&) {
      driven = step.distance;
    };
    run_exploration(exploration);
  }

  void compare(const Situation& situation, const RecordingMapper& recorder, std::uint64_t seed,
               RandomNumbers& random) {
    Registry& registry = drives_.session().registry();
    const auto planner = drives_.make<PathPlanner>(options_.drives.planner);
    ComponentSpec every_move = parse_component(options_.drives.slam.mapper);
    every_move.values["tolerance"] = "0";
    const auto mapper = registry.make<Mapper>(every_move);
    PathSampler sampler(situation, recorder.scans(), recorder.poses(), *mapper, registry,
                        {.samples = options_.samples, .range = options_.range}, seed);
    PathSet set{.seed = seed,
                .decision = situation.decision,
                .map_entropy = situation.map.entropy(),
                .resolution = situation.map.frame.resolution,
                .lidar_range = situation.robot.lidar.range,
                .paths = {}};
    for (const PlannedPath& path : random_paths(situation, *planner, options_.candidates, random)) {
      if (interrupted()) return;
      set.paths.push_back(sampler.sample(path));
      if (drives_.line().on_terminal() || std::ssize(set.paths) == options_.candidates)
        drives_.line().show(fmt::format("seed {}, decision {}: {} of {} paths sampled", seed,
                                        situation.decision, set.paths.size(), options_.candidates));
    }
    if (set.paths.size() > 1) sets_.push_back(std::move(set));
  }

  const ObjectiveStudyOptions& options_;
  StudyDrives drives_;
  std::vector<PathSet> sets_;
};

// What is written ---------------------------------------------------------------------------------

/// Kendall's τ of one form with the sampled values, over the sets of paths.
struct Agreement {
  std::string form;
  MeanInterval value, per_metre;
};

double form_value(const JointObjective& objective, const PathSet& set, const SampledPath& path) {
  return objective.value(objective.change(path.trajectory, path.map, path.now, path.end),
                         set.map_entropy, path.now);
}

Agreement agreement(const Form& form, const std::vector<PathSet>& sets) {
  std::vector<double> by_value, by_metre;
  for (const PathSet& set : sets) {
    const JointObjective objective(form.options, set.resolution, set.lidar_range);
    std::vector<double> formed, formed_per_metre, sampled, sampled_per_metre;
    for (const SampledPath& path : set.paths) {
      const double value = form_value(objective, set, path);
      const double truth = path.trajectory + path.sampled_map;
      formed.push_back(value);
      formed_per_metre.push_back(value / path.length);
      sampled.push_back(truth);
      sampled_per_metre.push_back(truth / path.length);
    }
    by_value.push_back(kendall_tau(formed, sampled));
    by_metre.push_back(kendall_tau(formed_per_metre, sampled_per_metre));
  }
  return {form.name, mean_interval(by_value), mean_interval(by_metre)};
}

json::object interval_json(const MeanInterval& interval) {
  return {{"mean", number_json(interval.mean)},
          {"low", number_json(interval.low())},
          {"high", number_json(interval.high())},
          {"sets", interval.count}};
}

std::string paths_csv(const std::vector<PathSet>& sets) {
  std::string text =
      "seed,decision,path,length,loops,trajectory,map,sampled_map,standard_error,"
      "determinant_now,determinant_end\n";
  for (const PathSet& set : sets) {
    for (std::size_t k = 0; k < set.paths.size(); ++k) {
      const SampledPath& path = set.paths[k];
      text += fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", set.seed, set.decision, k,
                          path.length, path.loops, path.trajectory, path.map, path.sampled_map,
                          path.standard_error, path.now.determinant(), path.end.determinant());
    }
  }
  return text;
}

int run_study(const ObjectiveStudyOptions& options, Session& session) {
  check_file(options.paths, session);
  session.use_threads();
  Study study(options, session);
  const std::vector<PathSet> sets = study.run();
  std::vector<Agreement> rows;
  for (const Form& form : forms()) rows.push_back(agreement(form, sets));
  std::ranges::stable_sort(rows, std::ranges::greater{},
                           [](const Agreement& row) { return row.per_metre.mean; });

  Results results;
  results.write(options.paths, [&] { write_file(options.paths, paths_csv(sets)); });
  json::array rows_json;
  Table table({{"objective", Table::Align::left},
               {"τ, value per metre", Table::Align::right},
               {"τ, value", Table::Align::right}});
  for (const Agreement& row : rows) {
    rows_json.push_back({{"form", row.form},
                         {"tau_per_metre", interval_json(row.per_metre)},
                         {"tau", interval_json(row.value)}});
    table.add({row.form, interval_text(row.per_metre), interval_text(row.value)});
  }
  json::object report = begin_report("study");
  report["floor"] = options.drives.floor;
  report["sets"] = sets.size();
  report["samples"] = options.samples;
  report["rows"] = std::move(rows_json);
  report["status"] = study.interrupted() ? "interrupted" : "finished";
  end_report(report);
  results.add([&] { session.write_json(report); });
  results.add([&] {
    session.print(table.text(session.colour()));
    session.print(
        fmt::format("Kendall's τ with H(x) + ∫ p(x) H(m|x) dx by {} samples, {} sets of "
                    "paths, mean and 95 % interval\n",
                    options.samples, sets.size()));
  });
  results.finish();
  return study.interrupted() ? kExitInterrupted : 0;
}

}  // namespace

void add_study_objective(Registrar& registrar) {
  add_command<ObjectiveStudyOptions>(
      registrar, "study objective",
      "Example:\n"
      "  cairn study objective @rooms --runs 2 --samples 50 --paths paths.csv",
      run_study);
}

}  // namespace cairn::app
