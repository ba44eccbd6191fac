// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// A curve of three pieces, arcs of one radius and straight lines, which a vehicle drives that goes
/// forward only and can't turn in place (Dubins 1957).
struct DubinsCurve {
  std::array<int, 3> turns{};       ///< of each piece: 1 left, 0 straight, −1 right
  std::array<double, 3> lengths{};  ///< of each piece [m]
  double radius = 1.0;              ///< of the arcs [m]

  double length() const { return lengths[0] + lengths[1] + lengths[2]; }
  /// Where the vehicle is after `distance` [m], in the frame of the curve's beginning.
  CAIRN_API Pose2 at(double distance) const;
};

/// Where an arc of this curvature [1/m], to the left where it is positive, leads from the identity
/// after `length` [m].
CAIRN_API Pose2 along_arc(double curvature, double length);

/// The curves of all words that lead from the identity to `to`, shortest first: LSL, RSR, LSR, RSL,
/// RLR and LRL, of which each is left out where it does not exist. The first is the shortest of all
/// ways for a vehicle whose least turning radius [m] this is; the others are for obstacles in its
/// way.
///
///     double length = dubins_curves(from.between(to), 0.5).front().length();
CAIRN_API std::vector<DubinsCurve> dubins_curves(const Pose2& to, double radius);

}  // namespace cairn
