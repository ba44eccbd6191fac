// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/policy/pose_policy.hpp"
#include "measured.hpp"

namespace cairn::compact {

/// What a pose measures of a landmark in the graph, linearised: e + J_p δ_pose + J_l δ_landmark.
struct ObservationRows {
  Eigen::VectorXd e;
  Eigen::MatrixXd J_pose, J_landmark;
  int landmark = 0;  ///< in the joint covariance
};

/// Of all factors on a landmark and a pose, one below the other, at these states.
ObservationRows linearized(std::span<const Measured> factors, Id pose, const double* x,
                           const double* landmark);

/// What came of it.
struct ObservationFit {
  MeasuredFit fit;
  bool informative = false;  ///< its information gain exceeds the threshold
  bool linear = true;        ///< `MayUse::linear`, where it was asked for
  bool used = false;
};

/// What an observation must meet to be used, however much it gains.
struct MayUse {
  std::function<bool(const MeasuredFit&)> fits;
  /// Of an observation, by its number, and the joint covariance of its landmark and, after it, the
  /// pose.
  std::function<bool(std::size_t, const Eigen::MatrixXd&)> linear;
};

/// Chooses among the observations of a pose, with the joint covariance Σ of the landmarks, in order
/// and of so many numbers each, and after them the pose: the one whose information gain
/// ½ ln |I + J Σ Jᵀ| is largest, then, with the mean and Σ that it leaves (as of a Kalman filter),
/// the next, until none of those that may be used gains more than `least_gain` [nats]. The gain of
/// one is never increased by another.
std::vector<ObservationFit> choose_observations(std::span<const ObservationRows> observations,
                                                std::span<const int> landmark_sizes,
                                                Eigen::MatrixXd covariance, double least_gain,
                                                const MayUse& may_use);

/// A factor on a landmark and a pose. Throws `Error` (input) if it is not one.
Measured checked_observation(const Factor& factor, Id pose, const VariableType& pose_type,
                             const Variable& landmark);

/// What is reported of it; `factors`: of the observation.
LandmarkReport report_of(Id pose, Id landmark, std::size_t factors, const ObservationFit& fit);

}  // namespace cairn::compact
