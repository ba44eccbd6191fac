// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// How much of the map is known around a place, within 1 m of it along each axis, at some time:
/// from that an explorer can see whether it is worth going there again after it has looked in vain.
class CAIRN_API KnownSurroundings {
 public:
  /// `at`: in the frame of the map [m].
  KnownSurroundings(const FloorMap& map, const Eigen::Vector2d& at);

  const Eigen::Vector2d& at() const { return at_; }
  /// Whether as many cells are known there now as then.
  bool same_as(const FloorMap& map) const;
  /// Whether more are known there now, by a twentieth of all cells there. Single cells change with
  /// every scan where measurements have noise.
  bool more_in(const FloorMap& map) const;

 private:
  Eigen::Vector2d at_;
  std::size_t known_;  ///< cells
};

}  // namespace cairn
