// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "cairn/policy/policy_run.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn {

/// The covariance that a compact graph gives its poses, beside that of the same poses given
/// everything that was measured. Norms are Frobenius norms.
struct UncertaintyStep {
  Id pose = 0;                ///< newest pose
  int kept = 0;               ///< poses compared
  double marginal = 0.0;      ///< norm of the compact graph's marginal covariances, side by side
  double marginal_all = 0.0;  ///< of those with everything
  double full = 0.0;          ///< norm of the compact graph's joint covariance
  double full_all = 0.0;      ///< of that with everything
  double least_eigenvalue = 0.0;  ///< of Σ_all⁻¹ Σ over the poses' marginals; < 1: overconfident

  CAIRN_API static ResultFields<UncertaintyStep> fields();
};

/// Whether a policy is conservative: it is compared with an estimator that takes in every pose and
/// every recorded link. That estimator's covariance of the kept poses is what exact marginalisation
/// of all others leaves.
class CAIRN_API UncertaintyComparison {
 public:
  /// `everything` is an estimator without variables. `data` must outlive this object.
  UncertaintyComparison(const PolicyData& data, std::unique_ptr<Estimator> everything);
  /// After the policy has ended pose number `index` of the recording; every pose in turn.
  void add(std::size_t index, PosePolicy& policy);
  const std::vector<UncertaintyStep>& steps() const { return steps_; }

 private:
  const PolicyData& data_;
  std::unique_ptr<Estimator> everything_;
  std::vector<UncertaintyStep> steps_;
};

/// How often a compact graph was at least as uncertain as it should be, over all steps.
struct Conservativeness {
  double marginal = 0.0;  ///< part of the steps, by the norm of the marginals
  double full = 0.0;      ///< by that of the joint covariance
  double least_marginal_ratio = 1e300, least_full_ratio = 1e300;  ///< compact over everything
  double least_eigenvalue = 1e300;

  CAIRN_API static ResultFields<Conservativeness> fields();
};
/// Ratios down to 1e-6 below 1 count as rounding.
CAIRN_API Conservativeness conservativeness(std::span<const UncertaintyStep> steps);

}  // namespace cairn
