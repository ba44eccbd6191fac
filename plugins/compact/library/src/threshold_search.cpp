// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/threshold_search.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/normalized_error.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/timed.hpp"

namespace cairn {
namespace {

using Clock = std::chrono::steady_clock;

/// Trials in one direction.
constexpr int kMostTrials = 10;
const double kStep = std::sqrt(2.0);
/// Measurements that agree with one another better than that were computed from a result.
constexpr double kLeastNoiseScale = 1e-3;

std::vector<Id> kept_poses(const PosePolicy& policy) {
  std::vector<Id> ids = policy.kept();
  std::ranges::sort(ids);
  return ids;
}

/// Those of the compact graph that are nearest to given ones.
std::vector<Id> nearest(const std::vector<Id>& wanted, const std::vector<Id>& there) {
  std::vector<Id> found;
  for (const Id id : wanted) {
    const auto at = std::ranges::lower_bound(there, id);
    found.push_back(at == there.end() ? there.back() : *at);
  }
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

/// The sample with everything taken in.
struct Everything {
  Trajectory trajectory;
  std::vector<Id> poses;  ///< where errors are looked at
  double noise = 1.0;     ///< `noise_scale`
  double expected = 0.0;  ///< [m]
};

/// By the covariances as they are.
double expected_error(PosePolicy& policy, const std::vector<Id>& poses) {
  Estimator& estimator = policy.estimator();
  return expected_ate(estimator, estimator.graph(), poses);
}

/// What all trials share.
struct Sample {
  const PolicyJob& job;
  const PolicySetting& setting;
  std::size_t count;
  Everything everything;
};

ThresholdTrial try_thresholds(const Sample& sample, const OptionValues& options, double links,
                              double poses) {
  PolicyJob trial = sample.job;
  for (const auto& [name, value] : options) trial.policy.values.emplace(name, value);
  PolicyRun run(trial, sample.setting);
  run.run(sample.count, fmt::format("sample, gains × {:.2g} {:.2g}", links, poses));
  ThresholdTrial result{.links = links, .poses = poses};
  const std::vector<Id> kept = kept_poses(run.policy());
  result.poses_kept = static_cast<int>(std::ssize(kept));
  result.loops_kept = run.counts().kept_loops;
  const double apart =
      absolute_error(trajectory(recovered_trajectory(run.policy(), Recovery::likely)),
                     sample.everything.trajectory);
  result.expected = sample.everything.noise *
                    expected_error(run.policy(), nearest(sample.everything.poses, kept));
  result.realised = std::hypot(sample.everything.expected, apart);
  return result;
}

OptionFinder& finder_of(PosePolicy& policy, const PolicyJob& job) {
  auto* finder = query<OptionFinder>(policy);
  if (!finder) {
    throw Error(ErrorCode::usage, fmt::format("policy '{}' does not find its options by itself: "
                                              "give them as {}:key=value",
                                              job.policy.name, job.policy.name));
  }
  return *finder;
}

/// With fewer loop closures in it, a sample is extended.
constexpr std::int64_t kLeastLoops = 3;

}  // namespace

double noise_scale(const Graph& graph, double chi2) {
  const std::int64_t dof = degrees_of_freedom(graph, resolve_gauge(graph));
  if (dof <= 0 || !std::isfinite(chi2)) return 1.0;
  return std::clamp(std::sqrt(chi2 / static_cast<double>(dof)), kLeastNoiseScale, 1.0);
}

bool finds_thresholds(const ComponentSpec& policy, Registry& registry) {
  return query<OptionFinder>(*registry.make<PosePolicy>(policy.name)) != nullptr;
}

bool gives_thresholds(const ComponentSpec& policy) {
  return policy.values.contains("range") || policy.values.contains("loop_gain") ||
         policy.values.contains("pose_gain");
}

ThresholdSample threshold_sample(const PolicyData& data, double part) {
  const auto poses = static_cast<double>(data.poses.size());
  const auto asked = std::max<std::size_t>(1, static_cast<std::size_t>(std::llround(part * poses)));
  std::int64_t loops = 0;
  std::size_t count = 0;
  while (count < data.poses.size() && (count < asked || loops < kLeastLoops))
    loops += std::ssize(data.poses[count++].links);
  return {asked, loops == 0 ? asked : count};
}

void refine_thresholds(const OptionFinder& finder, const ThresholdTest& test,
                       FoundThresholds& found, const std::function<bool()>& interrupted) {
  const OptionValues first = found.options;
  double least = std::numeric_limits<double>::infinity();
  const auto attempt = [&](double links, double poses) {
    const OptionValues options = finder.scaled(first, links, poses);
    found.trials.push_back(test(options, links, poses));
    ThresholdTrial& trial = found.trials.back();
    trial.options = options;
    const bool good = trial.error() <= found.tolerance;
    if (good || trial.error() < least) {  // if none is good, the one with the least error
      found.options = options;
      found.chosen = found.trials.size() - 1;
      least = trial.error();
    }
    return !good && !(interrupted && interrupted());
  };
  if (!attempt(1.0, 1.0)) return;
  double factor = 1.0;
  for (int k = 0; k < kMostTrials; ++k) {
    // Where lower gains let no more links through, it is poses that are missing.
    const std::size_t n = found.trials.size();
    const std::int64_t loops = found.trials.back().loops_kept;
    if (n > 2 && loops > 0 && loops == found.trials[n - 3].loops_kept) break;
    if (!attempt(factor /= kStep, 1.0)) return;
  }
  factor = 1.0;
  for (int k = 0; k < kMostTrials; ++k) {
    factor /= kStep;
    if (!attempt(factor, factor)) return;
  }
}

FoundThresholds find_thresholds(const PolicyJob& job, std::size_t count, double error_ratio,
                                const PolicySetting& setting) {
  const auto begin = Clock::now();
  PolicyJob watching = job;
  const auto chosen = setting.registry.make<PosePolicy>(job.policy);
  const bool recorded_only =
      job.own ? job.own->matches_recorded_only()
              : setting.registry.make<Registration>(job.registration)->matches_recorded_only();
  if (recorded_only && setting.data.loops == 0) {
    throw Error(
        ErrorCode::input,
        "the recording has no loop closure: there is nothing to close, nor anything in "
        "which thresholds could be found; to keep fewer poses all the same, give the sensor's "
        "range, or use sparsify");
  }
  for (const auto& [name, value] : finder_of(*chosen, job).watching(recorded_only))
    watching.policy.values.insert_or_assign(name, value);
  PolicyRun watch(watching, setting);
  watch.run(count, "sample");
  const OptionFinder& finder = finder_of(watch.policy(), job);

  FoundThresholds found;
  if (setting.interrupted()) return found;
  found.options = finder.found();
  if (error_ratio > 0.0) {
    Sample sample{job, setting, count, {}};
    const Graph all = watch.policy().estimator().graph();
    sample.everything.trajectory = trajectory(all);
    sample.everything.poses = evenly_spread(kept_poses(watch.policy()));
    const double noise = noise_scale(all, watch.policy().estimator().chi2());
    sample.everything.noise = noise;
    sample.everything.expected = noise * expected_error(watch.policy(), sample.everything.poses);
    found.noise_scale = noise;
    found.expected_ate = sample.everything.expected;
    found.tolerance = std::max(error_ratio * found.expected_ate, noise * finder.accuracy());
    const auto test = [&](const OptionValues& options, double links, double poses) {
      return try_thresholds(sample, options, links, poses);
    };
    refine_thresholds(finder, test, found, [&] { return setting.interrupted(); });
  }
  found.seconds = seconds_since(begin);
  return found;
}

ResultFields<ThresholdTrial> ThresholdTrial::fields() {
  using T = ThresholdTrial;
  return ResultFields<T>()
      .figure("loop_gain_factor", &T::links, "by which the gain of links that was found is scaled")
      .figure("pose_gain_factor", &T::poses, "by which the gain of poses that was found is scaled")
      .figure("expected_error", &T::expected, "m", "that the covariances predict")
      .figure("realised_error", &T::realised, "m",
              "the same, by the distance from the estimate of everything")
      .figure("poses", &T::poses_kept, "poses that were kept")
      .figure("loops", &T::loops_kept, "loop closures that were kept");
}

ResultFields<FoundThresholds> FoundThresholds::fields() {
  using F = FoundThresholds;
  return ResultFields<F>()
      .figure("found", &F::options, "options of the policy that were found, as texts")
      .figure("trials", &F::trials, "each trial of thresholds in the sample")
      .figure("chosen", &F::chosen, "the trial with the thresholds that were found, from 0")
      .figure("noise_scale", &F::noise_scale,
              "by how much residuals are smaller than the covariances of the measurements say")
      .figure("expected_ate", &F::expected_ate, "m", "error of the sample with everything")
      .figure("tolerance", &F::tolerance, "m", "what the error of a trial may be")
      .figure("seconds", &F::seconds, "s", "finding thresholds")
      .details();
}

}  // namespace cairn
