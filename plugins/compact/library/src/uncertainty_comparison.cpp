// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/uncertainty_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Core>

#include "cairn/runtime/result_fields.hpp"
#include "dense/cholesky.hpp"
#include "dense/eigenvalues.hpp"

namespace cairn {

UncertaintyComparison::UncertaintyComparison(const PolicyData& data,
                                             std::unique_ptr<Estimator> everything)
    : data_(data), everything_(std::move(everything)) {}

void UncertaintyComparison::add(std::size_t index, PosePolicy& policy) {
  const Graph& graph = data_.recording;
  const int pose = data_.poses[index].pose();
  GraphUpdate update = arrival_update(graph, data_.poses[index]);
  leave_states_to_factors(update, *everything_);
  everything_->update(update);

  Estimator& compact = policy.estimator();
  std::vector<Id> poses = policy.kept();
  poses.erase(poses.begin());  // the first is held
  UncertaintyStep step{.pose = graph.id(pose),
                       .kept = static_cast<int>(std::ssize(poses)),
                       .least_eigenvalue = std::numeric_limits<double>::infinity()};
  const int n = graph.type(pose).tangent_size();
  const std::vector<double> of_compact = joint_covariance(compact, poses, n),
                            of_all = joint_covariance(*everything_, poses, n);
  const Eigen::Index rows = std::ssize(poses) * n;
  const Eigen::Map<const Eigen::MatrixXd> Sigma(of_compact.data(), rows, rows),
      Sigma_all(of_all.data(), rows, rows);
  for (Eigen::Index at = 0; at < Sigma.rows(); at += n) {
    const Eigen::MatrixXd S = Sigma.block(at, at, n, n), S_all = Sigma_all.block(at, at, n, n);
    step.marginal += S.squaredNorm();
    step.marginal_all += S_all.squaredNorm();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> parts(
        S, S_all, Eigen::EigenvaluesOnly | Eigen::Ax_lBx);
    step.least_eigenvalue = std::min(step.least_eigenvalue, parts.eigenvalues().minCoeff());
  }
  step.marginal = std::sqrt(step.marginal);
  step.marginal_all = std::sqrt(step.marginal_all);
  step.full = Sigma.norm();
  step.full_all = Sigma_all.norm();
  if (!poses.empty()) steps_.push_back(step);
}

Conservativeness conservativeness(std::span<const UncertaintyStep> steps) {
  constexpr double kRounding = 1e-6;
  Conservativeness result;
  std::size_t marginal = 0, full = 0;
  for (const UncertaintyStep& step : steps) {
    const double by_marginal = step.marginal / step.marginal_all,
                 by_full = step.full / step.full_all;
    marginal += by_marginal > 1.0 - kRounding;
    full += by_full > 1.0 - kRounding;
    result.least_marginal_ratio = std::min(result.least_marginal_ratio, by_marginal);
    result.least_full_ratio = std::min(result.least_full_ratio, by_full);
    result.least_eigenvalue = std::min(result.least_eigenvalue, step.least_eigenvalue);
  }
  const auto count = static_cast<double>(std::max<std::size_t>(1, steps.size()));
  result.marginal = static_cast<double>(marginal) / count;
  result.full = static_cast<double>(full) / count;
  return result;
}

ResultFields<UncertaintyStep> UncertaintyStep::fields() {
  using S = UncertaintyStep;
  return ResultFields<S>()
      .figure("pose", &S::pose, "id of the newest pose")
      .figure("kept", &S::kept, "poses compared")
      .figure("marginal", &S::marginal, "norm of the compact graph's marginal covariances")
      .figure("marginal_all", &S::marginal_all, "of those with everything")
      .figure("full", &S::full, "norm of the compact graph's joint covariance")
      .figure("full_all", &S::full_all, "of that with everything")
      .figure("least_eigenvalue", &S::least_eigenvalue,
              "of the compact covariances by those with everything; below 1: overconfident");
}

ResultFields<Conservativeness> Conservativeness::fields() {
  using C = Conservativeness;
  return ResultFields<C>()
      .figure("marginal_conservative", &C::marginal,
              "part of the steps whose marginals are at least as uncertain as with everything")
      .figure("full_conservative", &C::full, "the same of the joint covariance")
      .figure("least_marginal_ratio", &C::least_marginal_ratio, "compact over everything")
      .figure("least_full_ratio", &C::least_full_ratio, "the same of the joint covariance")
      .figure("least_eigenvalue", &C::least_eigenvalue, "the least of all steps");
}

}  // namespace cairn
