// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cairn/solve/estimator.hpp"
#include "compact_run.hpp"

namespace cairn::app {

/// The covariances of a compact graph's poses beside those of the same poses from all measurements.
/// Norms are Frobenius'.
struct UncertaintyStep {
  Id pose = 0;                ///< newest pose of the trajectory
  int kept = 0;               ///< poses compared
  double marginal = 0.0;      ///< of the compact graph's marginal covariances, side by side
  double marginal_all = 0.0;  ///< of the same poses' with everything
  double full = 0.0;          ///< of the joint covariance
  double full_all = 0.0;
  double least_eigenvalue = 0.0;  ///< of Σ_all⁻¹ Σ over the poses' marginals; < 1: overconfident
};

/// Follows a policy with an estimator that takes in every pose and every recorded link. Its
/// covariance of the kept poses is what exact marginalisation of all others leaves.
class UncertaintyComparison {
 public:
  explicit UncertaintyComparison(const CompactSetting& setting);
  /// After the policy has ended pose number `index` of the recording.
  void add(std::size_t index, PosePolicy& policy);
  const std::vector<UncertaintyStep>& steps() const { return steps_; }

 private:
  const Recording& recording_;
  std::unique_ptr<Estimator> everything_;
  std::vector<UncertaintyStep> steps_;
};

std::string comparison_csv(const std::vector<UncertaintyStep>& steps);

}  // namespace cairn::app
