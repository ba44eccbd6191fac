// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/pose_chain.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/geometry/state_group.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"

namespace cairn {

// Recovery ----------------------------------------------------------------------------------------

namespace {

void check(const VariableType& type, const OdometryChain& chain, std::span<const double> from,
           std::span<const double> to) {
  if (!type.lie_group() || !has_position(type)) {
    throw Error(ErrorCode::usage,
                fmt::format("recover: {} lacks the ability LieGroup or Placement; poses such "
                            "as VERTEX_SE2 and VERTEX_SE3:QUAT have",
                            type.tag()));
  }
  const std::size_t size = static_cast<std::size_t>(type.ambient_size());
  const bool fit = from.size() == size && to.size() == size &&
                   std::ranges::all_of(chain.steps, [&](const ChainStep& step) {
                     return step.motion.size() == size;
                   });
  if (!fit) {
    throw Error(ErrorCode::usage,
                fmt::format("recover: a state or a motion of {} is {} numbers", type.tag(), size));
  }
}

/// w_1 … w_q: which share of the way is behind the robot after each step.
std::vector<double> shares_of_way(const VariableType& type, const OdometryChain& chain,
                                  Recovery how) {
  const int d = type.placement()->dimension();
  std::vector<double> shares;
  double way = 0.0;
  for (const ChainStep& step : chain.steps) {
    const Eigen::VectorXd t = position(type, step.motion).head(d);
    way += t.stableNorm();
    shares.push_back(way);
  }
  const double steps = static_cast<double>(shares.size());
  const bool uniform = how == Recovery::uniform || !(way > 0.0);
  for (std::size_t m = 0; m < shares.size(); ++m)
    shares[m] = uniform ? static_cast<double>(m + 1) / steps : shares[m] / way;
  return shares;
}

std::vector<Eigen::VectorXd> shared_corrections(const std::vector<double>& shares,
                                                const Eigen::VectorXd& mismatch) {
  std::vector<Eigen::VectorXd> corrections;
  for (const double share : shares) corrections.push_back(share * mismatch);
  return corrections;
}

/// K_m d of each step, from the last to the first: Ad((z_{m+1} ⋯ z_q)⁻¹)ᵀ P_q⁻¹ d is carried back.
std::vector<Eigen::VectorXd> likely_corrections(const StateGroup& group, const OdometryChain& chain,
                                                const Eigen::VectorXd& mismatch) {
  const Eigen::Index n = mismatch.size();
  std::vector<Eigen::MatrixXd> adjoints, P;
  for (const ChainStep& step : chain.steps) {
    if (std::ssize(step.covariance) != n * n) {
      throw Error(
          ErrorCode::usage,
          fmt::format("recover: the likely recovery needs the covariance of every step, and "
                      "that to pose {} has none",
                      step.pose));
    }
    adjoints.push_back(group.adjoint(group.inverse(step.motion)));
    Eigen::MatrixXd sum = Eigen::Map<const Eigen::MatrixXd>(step.covariance.data(), n, n);
    if (!P.empty()) sum += adjoints.back() * P.back() * adjoints.back().transpose();
    P.push_back(std::move(sum));
  }
  std::vector<Eigen::VectorXd> corrections(P.size());
  Eigen::VectorXd carried = Eigen::VectorXd::Zero(n);
  for (std::size_t m = P.size(); m-- > 0;) {
    carried = m + 1 == P.size() ? Eigen::VectorXd(P.back().ldlt().solve(mismatch))
                                : Eigen::VectorXd(adjoints[m + 1].transpose() * carried);
    corrections[m] = P[m] * carried;
  }
  return corrections;
}

}  // namespace

std::vector<RecoveredPose> recover(const VariableType& type, const OdometryChain& chain,
                                   std::span<const double> from, std::span<const double> to,
                                   Recovery how) {
  check(type, chain, from, to);
  const StateGroup group(type);
  const std::vector<double> w = shares_of_way(type, chain, how);

  // x_from (z_1 ⋯ z_m), or x_from alone: what v0 and v1 take for the measured motions.
  std::vector<std::vector<double>> reckoned;
  std::vector<double> x(from.begin(), from.end());
  for (const ChainStep& step : chain.steps) {
    if (how == Recovery::distribute || how == Recovery::likely)
      x = group.normalized(group.compose(x, step.motion));
    reckoned.push_back(x);
  }
  const Eigen::VectorXd mismatch = group.log(group.normalized(group.between(x, to)));

  std::vector<RecoveredPose> poses;
  const std::vector<Eigen::VectorXd> corrections = how == Recovery::likely
                                                       ? likely_corrections(group, chain, mismatch)
                                                       : shared_corrections(w, mismatch);
  for (std::size_t m = 0; m < reckoned.size(); ++m) {
    poses.push_back({chain.steps[m].pose,
                     group.normalized(group.compose(reckoned[m], group.exp(corrections[m])))});
  }
  if (!poses.empty()) poses.back().state.assign(to.begin(), to.end());  // to the last bit
  return poses;
}

}  // namespace cairn
