// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/pose_chain.hpp"

#include <algorithm>
#include <cmath>
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

/// w_1 … w_q of the steps: which share of the way is behind the robot after each.
std::vector<double> shares_of_way(const VariableType& type, std::span<const ChainStep> steps,
                                  Recovery how) {
  std::vector<double> shares;
  double way = 0.0;
  for (const ChainStep& step : steps) {
    const Pose moved = pose_of(type, step.motion);
    way += std::hypot(moved.t.stableNorm(), rotation_angle(moved.R));
    shares.push_back(way);
  }
  const double count = static_cast<double>(shares.size());
  const bool uniform = how == Recovery::uniform || !(way > 0.0);
  for (std::size_t m = 0; m < shares.size(); ++m)
    shares[m] = uniform ? static_cast<double>(m + 1) / count : shares[m] / way;
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

/// x_from (z_1 ⋯ z_m) of every step.
std::vector<std::vector<double>> reckoned(const StateGroup& group, std::span<const double> from,
                                          std::span<const ChainStep> steps) {
  std::vector<std::vector<double>> states;
  std::vector<double> x(from.begin(), from.end());
  for (const ChainStep& step : steps) {
    x = group.normalized(group.compose(x, step.motion));
    states.push_back(x);
  }
  return states;
}

void append_corrected(const StateGroup& group, std::span<const ChainStep> steps,
                      const std::vector<std::vector<double>>& states,
                      const std::vector<Eigen::VectorXd>& corrections,
                      std::vector<RecoveredPose>& poses) {
  for (std::size_t m = 0; m < steps.size(); ++m) {
    poses.push_back(
        {steps[m].pose, group.normalized(group.compose(states[m], group.exp(corrections[m])))});
  }
}

/// v0 to v2.
void recover_by_distance(const VariableType& type, const StateGroup& group,
                         const OdometryChain& chain, std::span<const double> from,
                         std::span<const double> to, Recovery how,
                         std::vector<RecoveredPose>& poses) {
  std::span<const ChainStep> way = chain.steps;
  std::vector<double> begin(from.begin(), from.end()), end(to.begin(), to.end());
  // A chain that is nothing but a match has no way.
  if (way.size() > 1 && way.front().matched) {
    begin = group.normalized(group.compose(begin, way.front().motion));
    poses.push_back({way.front().pose, begin});
    way = way.subspan(1);
  }
  const bool to_match = way.size() > 1 && way.back().matched;
  if (to_match) {
    end = group.normalized(group.compose(end, group.inverse(way.back().motion)));
    way = way.first(way.size() - 1);
  }
  const bool along = how == Recovery::distribute;
  const std::vector<std::vector<double>> states =
      along ? reckoned(group, begin, way) : std::vector(way.size(), begin);
  const Eigen::VectorXd mismatch = group.log(group.normalized(group.between(states.back(), end)));
  append_corrected(group, way, states, shared_corrections(shares_of_way(type, way, how), mismatch),
                   poses);
  if (to_match) poses.push_back({chain.steps.back().pose, {to.begin(), to.end()}});
}

}  // namespace

std::vector<RecoveredPose> recover(const VariableType& type, const OdometryChain& chain,
                                   std::span<const double> from, std::span<const double> to,
                                   Recovery how) {
  check(type, chain, from, to);
  const StateGroup group(type);
  std::vector<RecoveredPose> poses;
  if (chain.steps.empty()) return poses;
  if (how == Recovery::likely) {
    const std::vector<std::vector<double>> states = reckoned(group, from, chain.steps);
    const Eigen::VectorXd mismatch = group.log(group.normalized(group.between(states.back(), to)));
    append_corrected(group, chain.steps, states, likely_corrections(group, chain, mismatch), poses);
  } else {
    recover_by_distance(type, group, chain, from, to, how, poses);
  }
  poses.back().state.assign(to.begin(), to.end());  // to the last bit
  return poses;
}

}  // namespace cairn
