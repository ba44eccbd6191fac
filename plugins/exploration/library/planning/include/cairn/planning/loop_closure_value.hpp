// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"
#include "cairn/planning/joint_objective.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// What a loop closure with a pose of the trajectory would do, if the robot turned up where it can
/// be matched with that pose.
struct LoopClosureValue {
  Id id = 0;
  Pose2 pose;           ///< as estimated
  double change = 0.0;  ///< of the trajectory's entropy [nats]; never above zero
};

/// −ln |I + J Σ Jᵀ Ω| (thesis, 5.8), or half of it with `EntropyForm::standard`: the change of the
/// trajectory's entropy by a loop closure of `earlier` with the newest pose, if it stood at
/// `earlier` with its covariances as they are now. Σ_ii, Σ_it and Σ_tt are in world coordinates
/// (x, y [m], θ [rad]), `noise` is that of the relative pose in the frame of `earlier`.
///
/// The two poses then coincide, so that J Σ Jᵀ = R Σ_d Rᵀ with Σ_d = Σ_ii + Σ_tt − Σ_it − Σ_ti, the
/// covariance of the difference of the two, turned into the frame of `earlier`.
CAIRN_API double loop_closure_change(const Pose2& earlier, const Eigen::Matrix3d& ii,
                                     const Eigen::Matrix3d& it, const Eigen::Matrix3d& tt,
                                     const Eigen::Matrix3d& noise, EntropyForm form);

/// That of each kept pose, from the block diagonal and the last block column of the estimator's
/// covariance. Poses that the newest can be matched with where it stands are left out: that takes
/// no drive. Empty where H is singular.
CAIRN_API std::vector<LoopClosureValue> loop_closure_values(const Situation& situation,
                                                            EntropyForm form);

/// Whether a robot at `newer` can be matched with the pose `older` (the "match area" of the
/// thesis): offsets forward and to the left, in the frame of `older`, and headings.
CAIRN_API bool can_match(const Pose2& older, const Pose2& newer, const MatchModel& match);

/// Σ of the newest kept pose, if the first had a prior with `Situation::first_sigma`; in the frame
/// of that pose. None where H is singular.
CAIRN_API std::optional<Eigen::Matrix3d> newest_covariance(const Situation& situation);

}  // namespace cairn
