// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/evaluation/mean_interval.hpp"
#include "cairn/exploration/exploration.hpp"
#include "cairn/exploration/exploration_measures.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {

/// A run by the names of its parts, which are made anew for each run. Everything referred to must
/// outlive it.
struct ExplorationSetup {
  static constexpr double kSampleDistance = 5.0;  // [m]
  /// What a run is made of unless something else is named.
  static constexpr const char* kWorld = "lidar_building";
  static constexpr const char* kExplorer = "drrt_star";
  static constexpr const char* kPolicy = "compact_pose:range=2,angle=3.14,reuse=false,gate=0.9999";

  Registry& registry;
  ComponentSpec world, policy, registration, mapper;
  const OccupancyGrid& floor;
  std::span<const std::uint8_t> reachable = {};  ///< see `Exploration`
  std::optional<Pose2> start = {};               ///< none: the world chooses
  ExplorationLimits limits = {};
  MatchModel match = {};
  double decision_budget = std::numeric_limits<double>::infinity();  ///< see `Exploration` [s]
  double sample_distance = kSampleDistance;                          ///< see `Exploration` [m]
  const std::atomic<bool>* interrupt = nullptr;
  std::shared_ptr<const Loss> loop_loss = nullptr;  ///< see `Exploration`; runs share it
  bool match_consecutive = true;                    ///< see `Exploration`
};

/// What a caller wants to see of a run while it goes on; see `Exploration`.
struct ExplorationHooks {
  std::function<void(const Decision&, const Situation&)> decided = {};
  std::function<void(const ExplorationStep&, const FloorMap&)> moved = {};
};

/// A component with the seed of the run, if it has an option `seed` and that is not given: for
/// policies and registrations that draw random numbers.
CAIRN_API ComponentSpec with_seed(Registry& registry, std::string_view kind, ComponentSpec spec,
                                  std::uint64_t seed);

/// One run. `seed` is that of the world and of the explorer, and by `with_seed` of policy and
/// registration. Throws `Error` as its parts do.
CAIRN_API ExplorationResult run_exploration(const ExplorationSetup& setup,
                                            const ComponentSpec& explorer, std::uint64_t seed,
                                            const ExplorationHooks& hooks = {});
/// The same with an explorer that is there already, such as one of the calling program.
CAIRN_API ExplorationResult run_exploration(const ExplorationSetup& setup, Explorer& explorer,
                                            std::uint64_t seed, const ExplorationHooks& hooks = {});

/// What is compared: every explorer runs once with each of the seeds `first_seed`, `first_seed` + 1
/// …, which determine the noise of odometry and lidar, so that run k of all of them meets the same.
struct ExplorerComparison {
  ExplorationSetup setup;
  std::vector<ComponentSpec> explorers;
  int runs = 1;
  std::uint64_t first_seed = 1;
  int threads = 1;  ///< that runs are spread over; each run is on one
};

/// What is left of one run.
struct ComparedRun {
  std::size_t explorer = 0;  ///< index into `ExplorerComparison::explorers`
  std::uint64_t seed = 0;
  bool done = false;  ///< false: it failed, or was interrupted; then nothing below counts
  ExplorationEnd end = ExplorationEnd::finished;
  std::string why;  ///< how it ended, or the error
  bool plugin_fault = false;
  ExplorationMeasures measures;
  std::vector<ExplorationStep> steps;
  std::vector<MapSample> samples;
  std::vector<std::string> notes;
};

/// Runs all of them, in any order, and calls `ended` after each, one at a time. The result, by seed
/// and then in the order of the explorers, does not depend on the number of threads. A run that
/// fails does not keep the others from going on; where all fail, the first error is thrown. After
/// an interrupt no run begins.
///
/// While it works the process's arena has one thread (`set_threads`), and its own again afterwards.
CAIRN_API std::vector<ComparedRun> compare_explorers(
    const ExplorerComparison& comparison,
    const std::function<void(const ComparedRun&)>& ended = {});

// What the runs say -------------------------------------------------------------------------------

/// A measure of the runs of one explorer, by seed; NaN of runs that are not done. By its place
/// among `exploration_measures`.
CAIRN_API std::vector<double> values_of(std::span<const ComparedRun> runs, std::size_t explorer,
                                        std::size_t measure);

/// What maps are compared by at equal coverage.
enum class MapQuality {
  contradicted,  ///< `map_error` against `coverage`: what the robot itself can know (thesis, 5.14)
  wrong          ///< `wrong` against `seen`: beside the truth
};

/// The error of the map of a run against its coverage, both [m²].
CAIRN_API RunCurve error_over_coverage(const ComparedRun& run, MapQuality quality);

/// The differences of map errors at equal coverage between the runs of `explorer` and of
/// `reference` with the same seed [m²]: at the largest coverage that both runs reach.
CAIRN_API MeanInterval difference_at_equal_coverage(std::span<const ComparedRun> runs,
                                                    std::size_t explorer, std::size_t reference,
                                                    MapQuality quality, double confidence = 0.95);

/// A quantity of a run against the distance driven [m]. `floor_area` as for `measures_of`.
enum class StepQuantity { map_entropy, trajectory_entropy, coverage };
CAIRN_API RunCurve over_distance(const ComparedRun& run, StepQuantity quantity, double floor_area);
/// The same against the number of motions, as in the thesis's Figures 5.7 and 5.8.
CAIRN_API RunCurve over_motions(const ComparedRun& run, StepQuantity quantity, double floor_area);

}  // namespace cairn
