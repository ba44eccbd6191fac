// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/explorer.hpp"

namespace cairn::exploration {

/// What a path was expected to discover, and what drives have discovered of it.
class Discovery {
 public:
  /// A path was chosen that is expected to discover these cells [m]; it has done what it is driven
  /// for when this part of them is known (above 1: never).
  void expect(std::vector<Eigen::Vector2d> cells, double part);
  /// The robot has come to this pose, and taken a scan.
  void drive(const Pose2& pose) { driven_.push_back(pose); }
  bool is_done(const FloorMap& map) const;

  /// The cells that scans should have shown, since nothing known stands in between, and which are
  /// unknown yet: something that is not on the map keeps them from view, or scans contradict each
  /// other. Without leaving them out a robot might drive there for ever.
  const std::vector<Eigen::Vector2d>& not_found(const Situation& situation, double range);

 private:
  std::vector<Eigen::Vector2d> expected_, not_found_;
  double part_ = 0.0;
  std::vector<Pose2> driven_;  ///< since the last decision
};

}  // namespace cairn::exploration
