// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "cairn/plugin/options.hpp"
#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"

namespace cairn {

/// How a policy fares on a sample with given thresholds.
struct ThresholdTrial {
  double links = 1.0, poses = 1.0;  ///< factors of the gains that the policy found at first
  double expected = 0.0;            ///< error predicted by its covariance [m]
  double realised = 0.0;            ///< the same, by its distance from the estimate of everything
  std::int64_t poses_kept = 0, loops_kept = 0;
  OptionValues options{};  ///< with which it was run
  double error() const { return std::max(expected, realised); }

  CAIRN_API static ResultFields<ThresholdTrial> fields();
};

/// √(chi2 / degrees of freedom) of an estimate: by how much residuals are smaller than the
/// covariances of the measurements say; many files have round numbers there. At most 1: where
/// residuals are larger, the cause may be outliers, which nothing should get coarser for. 1 where
/// it is not known.
CAIRN_API double noise_scale(const Graph& graph, double chi2);

struct FoundThresholds {
  OptionValues options;
  std::vector<ThresholdTrial> trials;
  std::size_t chosen = 0;  ///< the trial with these options, if there is one
  /// Of the sample with everything (`cairn::noise_scale`): errors that the covariances predict are
  /// multiplied by it.
  double noise_scale = 1.0;
  double expected_ate = 0.0;  ///< of the sample with everything [m]
  double tolerance = 0.0;     ///< what the error of a trial may be [m]
  double seconds = 0.0;

  CAIRN_API static ResultFields<FoundThresholds> fields();
};

/// Finds a policy's thresholds on the first `count` poses of a recording: the policy watches the
/// sample with everything taken in, and chooses (Ila et al. 2017, section 5.2). Then, unless
/// `error_ratio` is 0, the choice is tried on the sample, and `refine_thresholds` lowers it until
/// the error is at most `error_ratio` times that of everything, or that of a single link. The error
/// is the larger of two estimates, neither of which needs the truth: what the covariances
/// predict (`expected_ate`, times `noise_scale`), and √(E² + D²) with E the expected error of
/// everything and D the distance between the two trajectories. Throws `Error` (usage) if the policy
/// is no `OptionFinder`, and (input) if the sample does not determine thresholds.
CAIRN_API FoundThresholds find_thresholds(const PolicyJob& job, std::size_t count,
                                          double error_ratio, const PolicySetting& setting);

/// Whether a policy finds its thresholds by itself: others are run with the options that are given.
CAIRN_API bool finds_thresholds(const ComponentSpec& policy, Registry& registry);
/// Whether thresholds are among its options, so that none are to be found.
CAIRN_API bool gives_thresholds(const ComponentSpec& policy);

/// So many poses of a recording, from the first on, in which thresholds are found.
struct ThresholdSample {
  std::size_t asked = 0;  ///< as the part says
  std::size_t count = 0;  ///< more, where those have too few loop closures
};
CAIRN_API ThresholdSample threshold_sample(const PolicyData& data, double part);

/// Runs a sample with the options; the factors of the gains are for the record.
using ThresholdTest =
    std::function<ThresholdTrial(const OptionValues& options, double links, double poses)>;

/// Lowers thresholds until the error of a trial is within `found.tolerance`: first the gains of
/// links, by factors of √2 and at most ten times, until lower ones let no more links through (none
/// at all is no reason to stop); then the gains of links and poses together, from the beginning.
/// `found.options` are what was found at first, and become those of the first trial that is good
/// or, if none is, of that with the least error. Stops early once `interrupted` returns true.
CAIRN_API void refine_thresholds(const OptionFinder& finder, const ThresholdTest& test,
                                 FoundThresholds& found,
                                 const std::function<bool()>& interrupted = {});

}  // namespace cairn
