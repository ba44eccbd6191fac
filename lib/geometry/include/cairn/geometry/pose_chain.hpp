// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/enum_names.hpp"

namespace cairn {

/// One pose between two consecutive poses of a compact graph.
struct ChainStep {
  Id pose = 0;                 ///< where the step ends
  std::vector<double> motion;  ///< measured, from the pose before [ambient_size]
  /// Σ of it, tangent × tangent, column-major; empty: not known.
  std::vector<double> covariance{};
  /// The robot did not move so: a pose of the chain was matched with the kept pose at its beginning
  /// (the first step leads from there to it) or at its end (the last step leads from it to there).
  bool matched = false;
};

/// Odometry between two poses that follow each other in a compact graph, and the poses that were
/// left out between them. The last step ends at `to`.
struct OdometryChain {
  Id from = 0, to = 0;
  std::vector<ChainStep> steps;
};

/// How the poses between two kept ones are put back: v0 to v2 as by Ila et al. 2017, equations 23
/// to 26.
enum class Recovery {
  uniform,      ///< v0: evenly along the geodesic between the two
  interpolate,  ///< v1: along it, in proportion to the measured distances
  distribute,   ///< v2: along the odometry, its mismatch distributed in proportion to distance
  likely,       ///< along the odometry, its mismatch distributed by maximum likelihood
};
constexpr auto enum_names(Recovery) {
  return std::to_array<EnumName<Recovery>>({{Recovery::uniform, "v0"},
                                            {Recovery::interpolate, "v1"},
                                            {Recovery::distribute, "v2"},
                                            {Recovery::likely, "likely"}});
}

/// A pose that was put back.
struct RecoveredPose {
  Id id = 0;
  std::vector<double> state;
};

/// The states of the poses of a chain but its first, given those of its two ends. With the relative
/// poses z_1 … z_q, w_m = Σ_{k≤m} ‖z_k‖ / Σ_{k≤q} ‖z_k‖, the norm being that of translation and
/// rotation vector together [m, rad] (m/q where nothing moves):
///
///     v0, v1:  x_from · exp(w_m log(x_from⁻¹ x_to)),  w_m = m/q for v0
///     v2:      x_from · (z_1 ⋯ z_m) · exp(w_m log((z_1 ⋯ z_q)⁻¹ x_from⁻¹ x_to))
///
/// Steps that are matched are taken as they are: these formulas hold between the poses that were
/// matched, from which the robot came and to which it drove, in place of `from` and `to`.
///
/// v2 turns the mismatch with the robot, which is wrong where the robot turns. `likely` does not:
/// given the mismatch d at the end, the expected perturbation at m is K_m d, with P_m the
/// first-order covariance of z_1 ⋯ z_m,
///
///     x_from · (z_1 ⋯ z_m) · exp(K_m d),  K_m = P_m Ad((z_{m+1} ⋯ z_q)⁻¹)ᵀ P_q⁻¹.
///
/// At m = q all of them give x_to. The type must have `LieGroup` and `Placement`; `likely` needs
/// the covariance of every step. Throws `Error` (usage) otherwise.
CAIRN_API std::vector<RecoveredPose> recover(const VariableType& type, const OdometryChain& chain,
                                             std::span<const double> from,
                                             std::span<const double> to, Recovery how);

}  // namespace cairn
