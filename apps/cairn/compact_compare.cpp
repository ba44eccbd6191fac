// SPDX-License-Identifier: BSD-3-Clause
#include "compact_compare.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

namespace cairn::app {
UncertaintyComparison::UncertaintyComparison(const CompactSetting& setting)
    : recording_(setting.recording),
      everything_(setting.session.registry().make<Estimator>("incremental_cholesky")) {}

void UncertaintyComparison::add(std::size_t index, PosePolicy& policy) {
  const Graph& graph = recording_.graph();
  const RecordedPose& pose = recording_.poses[index];
  GraphUpdate update;
  update.variables.push_back(new_variable(graph, pose.variable));
  if (index > 0 && !update.variables.back().fixed) update.variables.back().state.clear();
  for (const auto* factors : {&pose.odometry, &pose.links}) {
    for (const int f : *factors) update.factors.push_back(new_factor(graph, f));
  }
  everything_->update(update);

  Estimator& compact = policy.estimator();
  std::vector<Id> poses = policy.kept();
  poses.erase(poses.begin());  // the first is held
  UncertaintyStep step{.pose = graph.id(pose.variable),
                       .kept = static_cast<int>(std::ssize(poses)),
                       .least_eigenvalue = std::numeric_limits<double>::infinity()};
  const int n = graph.type(pose.variable).tangent_size();
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

std::string comparison_csv(const std::vector<UncertaintyStep>& steps) {
  std::string text = "pose,kept,marginal,marginal_all,full,full_all,least_eigenvalue\n";
  for (const UncertaintyStep& s : steps) {
    text += fmt::format("{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}\n", s.pose, s.kept, s.marginal,
                        s.marginal_all, s.full, s.full_all, s.least_eigenvalue);
  }
  return text;
}

}  // namespace cairn::app
