// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/state_group.hpp"
#include "cairn/types/variable_type.hpp"
#include "pair_random.hpp"

namespace cairn::registration {

/// The extent of a relative pose, or its limit.
struct Extent {
  double length = 0.0;  ///< of the translation [m]
  double angle = 0.0;   ///< of the rotation, 0 to π [rad]
};

/// Relative poses of one type of pose, by its abilities `LieGroup` and `Placement`.
class RigidMotions {
 public:
  /// Throws `Error` (usage) if the type lacks one of the two, or has no orientation.
  explicit RigidMotions(std::shared_ptr<const VariableType> type);

  /// x⁻¹ y
  std::vector<double> between(std::span<const double> x, std::span<const double> y) const;
  /// z exp(ξ)
  std::vector<double> perturbed(std::span<const double> z, const Eigen::VectorXd& xi) const;
  Extent extent(std::span<const double> motion) const;
  /// A random relative pose within that extent, uniformly distributed: translations uniform in the
  /// disc or ball, rotations by the group's invariant measure.
  std::vector<double> draw(const Extent& within, PairRandom& random) const;

  /// Which components of a tangent vector rotate a pose, and which translate it without rotation.
  const std::vector<int>& rotations() const { return rotations_; }
  const std::vector<int>& translations() const { return translations_; }

 private:
  StateGroup group_;
  std::shared_ptr<const VariableType> type_;  ///< keeps what group_ refers to
  std::vector<int> rotations_, translations_;
};

}  // namespace cairn::registration
