// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "compact_run.hpp"

namespace cairn::app {

/// One try of thresholds on the sample.
struct ThresholdTrial {
  double links = 1.0, poses = 1.0;  ///< factors of what the policy found at first
  double expected = 0.0;            ///< expected error [m]
  double realised = 0.0;  ///< the same, by the distance from the trajectory with everything
  std::int64_t poses_kept = 0, loops_kept = 0;
  double error() const { return std::max(expected, realised); }
};

struct FoundThresholds {
  OptionValues options;
  std::vector<ThresholdTrial> trials;
  double expected_ate = 0.0;  ///< of the sample with everything [m]
  double tolerance = 0.0;     ///< what a try's error may be [m]
  double seconds = 0.0;
};

/// Finds a policy's thresholds on the first `count` poses: it watches the sample with everything
/// taken in, and chooses (section 5.2 of Ila et al. 2017). Then, unless `error_ratio` is 0, it is
/// tried on the sample: the error may be `error_ratio` times that of everything, or as large as
/// that of a single link. If it is larger, gains for links fall by factors of √2 until it is not;
/// if that lets no more links through, those for poses fall, too. The error is the larger of two
/// estimates, neither of which needs the truth: what the covariances let expect (`expected_ate`),
/// and √(E² + D²) with E the expected error of everything and D the distance between the two
/// trajectories.
FoundThresholds find_thresholds(const CompactJob& job, std::size_t count, double error_ratio,
                                const CompactSetting& setting);

/// The file's policy must be this one. Throws `Error` (input).
OptionValues read_thresholds(const std::string& file, const std::string& policy);
void write_thresholds(const std::string& file, const std::string& policy,
                      const OptionValues& options);

}  // namespace cairn::app
