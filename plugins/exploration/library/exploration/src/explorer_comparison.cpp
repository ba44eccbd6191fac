// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/explorer_comparison.hpp"

#include <algorithm>
#include <exception>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// One thread in the arena while it lives: then parallel loops within runs are plain ones, and
/// runs on several threads do not wait for each other.
class OneThread {
 public:
  OneThread() : before_(threads()) { set_threads(1); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;
  ~OneThread() { set_threads(before_); }

 private:
  int before_;
};

class Comparing {
 public:
  Comparing(const ExplorerComparison& comparison,
            const std::function<void(const ComparedRun&)>& ended)
      : comparison_(comparison), ended_(ended) {
    for (int k = 0; k < comparison.runs; ++k) {
      for (std::size_t e = 0; e < comparison.explorers.size(); ++e) {
        ComparedRun& run = runs_.emplace_back();
        run.explorer = e;
        run.seed = comparison.first_seed + static_cast<std::uint64_t>(k);
        run.why = "it has not begun";
      }
    }
  }

  std::vector<ComparedRun> all() {
    const OneThread one;
    {
      std::vector<std::jthread> workers;
      const std::size_t most = runs_.size();
      const auto count = static_cast<std::size_t>(std::max(1, comparison_.threads));
      for (std::size_t k = 1; k < std::min(count, most); ++k) workers.emplace_back([&] { work(); });
      work();
    }
    if (escaped_) std::rethrow_exception(escaped_);
    const bool some = std::ranges::any_of(runs_, [](const ComparedRun& run) {
      return run.done || run.end == ExplorationEnd::interrupted;
    });
    if (!some && error_) std::rethrow_exception(error_);
    return std::move(runs_);
  }

 private:
  bool interrupted() const { return comparison_.setup.interrupt && *comparison_.setup.interrupt; }

  void work() {
    for (std::size_t k = next_++; k < runs_.size() && !interrupted(); k = next_++) {
      ComparedRun& run = runs_[k];
      try {
        explore(run);
      } catch (const Error& error) {
        run.why = error.what();
        run.plugin_fault = error.code() == ErrorCode::plugin;
        const std::lock_guard lock(mutex_);
        if (k < failed_) error_ = std::current_exception();
        failed_ = std::min(failed_, k);
      } catch (...) {  // such as a lack of memory: that of all
        const std::lock_guard lock(mutex_);
        escaped_ = std::current_exception();
        next_ = runs_.size();
        return;
      }
      const std::lock_guard lock(mutex_);
      if (ended_) ended_(run);
    }
  }

  void explore(ComparedRun& run) {
    const ExplorationSetup& setup = comparison_.setup;
    ExplorationResult result =
        run_exploration(setup, comparison_.explorers[run.explorer], run.seed);
    const GridFrame& frame = setup.floor.frame;
    run.end = result.end;
    run.done = result.end != ExplorationEnd::interrupted;
    run.why = std::move(result.why);
    run.measures = measures_of(result, static_cast<double>(frame.size()) * frame.cell_area());
    run.steps = std::move(result.steps);
    run.samples = std::move(result.samples);
    run.notes = std::move(result.notes);
    if (!result.converged) run.notes.emplace_back("the estimate has not converged");
  }

  const ExplorerComparison& comparison_;
  const std::function<void(const ComparedRun&)>& ended_;
  std::vector<ComparedRun> runs_;
  std::atomic<std::size_t> next_ = 0;
  std::mutex mutex_;
  std::exception_ptr error_, escaped_;
  std::size_t failed_ = std::numeric_limits<std::size_t>::max();
};

double quantity_of(const ExplorationStep& step, StepQuantity quantity, double floor_area) {
  switch (quantity) {
    case StepQuantity::map_entropy:
      return entropy_of_area(step.map_entropy, step.grid_area,
                             floor_area > 0.0 ? floor_area : step.grid_area);
    case StepQuantity::trajectory_entropy:
      return step.trajectory_entropy;
    case StepQuantity::coverage:
      return step.coverage;
  }
  return kUnknown;
}

}  // namespace

ComponentSpec with_seed(Registry& registry, std::string_view kind, ComponentSpec spec,
                        std::uint64_t seed) {
  constexpr const char* kSeed = "seed";
  if (!spec.values.contains(kSeed) && registry.options(kind, spec.name).find(kSeed))
    spec.values[kSeed] = fmt::format("{}", seed);
  return spec;
}

ExplorationResult run_exploration(const ExplorationSetup& setup, const ComponentSpec& explorer,
                                  std::uint64_t seed, const ExplorationHooks& hooks) {
  return run_exploration(setup, *setup.registry.make<Explorer>(explorer), seed, hooks);
}

ExplorationResult run_exploration(const ExplorationSetup& setup, Explorer& explorer,
                                  std::uint64_t seed, const ExplorationHooks& hooks) {
  Registry& registry = setup.registry;
  const auto world = registry.make<World>(setup.world);
  const auto policy =
      registry.make<PosePolicy>(with_seed(registry, PosePolicy::kKind, setup.policy, seed));
  const auto registration = registry.make<Registration>(
      with_seed(registry, Registration::kKind, setup.registration, seed));
  const auto mapper = registry.make<Mapper>(setup.mapper);
  return run_exploration(
      Exploration{.world = *world,
                  .policy = *policy,
                  .registration = *registration,
                  .mapper = *mapper,
                  .explorer = explorer,
                  .registry = registry,
                  .start = {.floor = &setup.floor, .pose = setup.start, .seed = seed},
                  .reachable = setup.reachable,
                  .limits = setup.limits,
                  .match = setup.match,
                  .decision_budget = setup.decision_budget,
                  .sample_distance = setup.sample_distance,
                  .interrupt = setup.interrupt,
                  .decided = hooks.decided,
                  .moved = hooks.moved,
                  .match_consecutive = setup.match_consecutive,
                  .loop_loss = setup.loop_loss});
}

std::vector<ComparedRun> compare_explorers(const ExplorerComparison& comparison,
                                           const std::function<void(const ComparedRun&)>& ended) {
  return Comparing(comparison, ended).all();
}

std::vector<double> values_of(std::span<const ComparedRun> runs, std::size_t explorer,
                              std::size_t measure) {
  std::vector<double> values;
  for (const ComparedRun& run : runs) {
    if (run.explorer == explorer)
      values.push_back(run.done ? value_of(run.measures, measure) : kUnknown);
  }
  return values;
}

RunCurve error_over_coverage(const ComparedRun& run, MapQuality quality) {
  RunCurve curve;
  for (const MapSample& sample : run.samples) {
    if (quality == MapQuality::contradicted) {
      curve.x.push_back(sample.coverage);
      curve.y.push_back(sample.error);
    } else if (sample.against) {
      curve.x.push_back(sample.against->seen);
      curve.y.push_back(sample.against->free_wrong + sample.against->occupied_wrong);
    }
  }
  return curve;
}

MeanInterval difference_at_equal_coverage(std::span<const ComparedRun> runs, std::size_t explorer,
                                          std::size_t reference, MapQuality quality,
                                          double confidence) {
  const auto largest = [](const RunCurve& curve) {
    return curve.x.empty() ? kUnknown : std::ranges::max(curve.x);
  };
  std::vector<double> values, references;
  for (const ComparedRun& run : runs) {
    if (run.explorer != explorer || !run.done) continue;
    const auto other = std::ranges::find_if(runs, [&](const ComparedRun& candidate) {
      return candidate.explorer == reference && candidate.seed == run.seed && candidate.done;
    });
    if (other == runs.end()) continue;
    const RunCurve mine = error_over_coverage(run, quality);
    const RunCurve theirs = error_over_coverage(*other, quality);
    const double place = std::min(largest(mine), largest(theirs));
    values.push_back(values_at(mine, {{place}}, BeyondEnd::unknown).front());
    references.push_back(values_at(theirs, {{place}}, BeyondEnd::unknown).front());
  }
  return paired_difference(values, references, confidence);
}

RunCurve over_distance(const ComparedRun& run, StepQuantity quantity, double floor_area) {
  RunCurve curve;
  for (const ExplorationStep& step : run.steps) {
    curve.x.push_back(step.distance);
    curve.y.push_back(quantity_of(step, quantity, floor_area));
  }
  return curve;
}

RunCurve over_motions(const ComparedRun& run, StepQuantity quantity, double floor_area) {
  RunCurve curve;
  for (const ExplorationStep& step : run.steps) {
    curve.x.push_back(step.step);
    curve.y.push_back(quantity_of(step, quantity, floor_area));
  }
  return curve;
}

}  // namespace cairn
