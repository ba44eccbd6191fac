// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "compact_run.hpp"

namespace cairn::app {

/// One try of thresholds on the sample.
struct ThresholdTrial {
  double factor = 1.0;                ///< of what the policy found at first
  double expected = 0.0;              ///< expected error over that with everything
  double realised = 0.0;              ///< the same, by how far the two trajectories are apart
  std::int64_t poses = 0, loops = 0;  ///< kept
  double ratio() const { return std::max(expected, realised); }
};

struct FoundThresholds {
  OptionValues options;
  std::vector<ThresholdTrial> trials;
  double expected_ate = 0.0;  ///< of the sample with everything [m]
  double seconds = 0.0;
};

/// Finds a policy's thresholds on the first `count` poses: it watches the sample with everything
/// taken in, and chooses (section 5.2 of Ila et al. 2017). Then, unless `error_ratio` is 0, it is
/// tried on the sample with more and more selective thresholds, or less and less so, by factors of
/// √2: what is chosen is the most selective try whose error is at most `error_ratio` times that of
/// everything. The error is the larger of two estimates, neither of which needs the truth: what the
/// covariances let expect (`expected_ate`), and √(E² + D²) with E the expected error of everything
/// and D the distance between the two trajectories.
FoundThresholds find_thresholds(const CompactJob& job, std::size_t count, double error_ratio,
                                const CompactSetting& setting);

/// The file's policy must be this one. Throws `Error` (input).
OptionValues read_thresholds(const std::string& file, const std::string& policy);
void write_thresholds(const std::string& file, const std::string& policy,
                      const OptionValues& options);

}  // namespace cairn::app
