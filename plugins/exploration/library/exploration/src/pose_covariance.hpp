// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include <Eigen/Core>

#include "cairn/solve/estimator.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// The covariance of ξ in T · exp(ξ), T the pose `id` in the plane, if the first pose, which is
/// fixed, had a prior with the standard deviations `first_sigma` [m, m, rad] instead. None where H
/// is singular.
std::optional<Eigen::Matrix3d> covariance_with_prior(Estimator& estimator, Id id,
                                                     const Pose2& first,
                                                     const Eigen::Vector3d& first_sigma);

}  // namespace cairn
