// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/policy/registration.hpp"
#include "rigid_motions.hpp"

namespace cairn::registration {

/// The relative factors of a recording, all on poses of one type; by position.
struct RecordedLinks {
  std::shared_ptr<const VariableType> pose;    ///< null where there are none
  std::shared_ptr<const FactorType> odometry;  ///< that of the first odometry factor
  std::vector<int> all;
  /// What the sensor for loop closures has measured; all, where there are no loop closures.
  std::vector<int> loops;
};

/// Throws `Error` (usage) if there is no recording, and (input) if its relative factors are on
/// poses of several types.
RecordedLinks recorded_links(const RegistrationData& data, std::string_view owner);

/// ln |Σ| of the covariance of a motion, n × n.
double log_determinant(const std::vector<double>& covariance, int n);

/// How uncertain loops are measured: the covariance of the one in the middle of them by the
/// determinants of their covariances; of the motion from the pose with the lower id to the other.
std::vector<double> median_covariance(const Graph& recording, const RecordedLinks& links,
                                      const MotionGroup& group);

/// How far apart poses were between which loops were measured: their longest translation, and
/// their largest angle.
Extent largest_extent(const Graph& recording, const RecordedLinks& links,
                      const RigidMotions& motions);

}  // namespace cairn::registration
