// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/joint_objective.hpp"

#include <cmath>

#include <Eigen/LU>

namespace cairn {

JointObjective::JointObjective(const JointObjectiveOptions& options, double resolution,
                               double range)
    : options_(options), reference_(options.reference) {
  if (reference_ > 0.0) return;
  const double translation = 0.5 * resolution * resolution;  // variances
  const double rotation = 2.0 * resolution * resolution / (range * range);
  reference_ = translation * translation * rotation;
}

double JointObjective::alpha(const Eigen::Matrix3d& covariance) const {
  if (options_.alpha == AlphaForm::none) return 1.0;
  return std::pow(reference_ / covariance.determinant(), options_.power);
}

InformationChange JointObjective::change(double trajectory, double map, const Eigen::Matrix3d& now,
                                         const Eigen::Matrix3d& end) const {
  return {.trajectory = trajectory,
          .map = map,
          .alpha = alpha(options_.alpha == AlphaForm::now ? now : end)};
}

double JointObjective::value(const InformationChange& change, double map_now,
                             const Eigen::Matrix3d& now) const {
  double value = change.trajectory + change.alpha * change.map;
  if (options_.alpha == AlphaForm::both) value += (change.alpha - alpha(now)) * map_now;
  return value;
}

}  // namespace cairn
