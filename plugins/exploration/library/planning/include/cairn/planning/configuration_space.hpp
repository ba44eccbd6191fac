// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cairn/exploration/floor_map.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/typed/pose2.hpp"

namespace cairn {

/// The free configurations (x, y, θ) of a robot with a round body on a map: the cells where it
/// fits, each with the same orientations 2π k/n (thesis, 5.3). Configurations are numbered by
/// orientation first; within one, cells are in the order of `GridFrame::index`.
class CAIRN_API ConfigurationSpace {
 public:
  /// The body fits in a cell with `needed_clearance`. Throws `Error` (usage) without orientations,
  /// or for more than 2³¹ configurations.
  ConfigurationSpace(const FloorMap& map, double radius, int orientations);

  const GridFrame& frame() const { return frame_; }
  int orientations() const { return orientations_; }
  /// Where the body fits, by `GridFrame::index`, rising.
  const std::vector<std::int32_t>& cells() const { return cells_; }
  std::size_t size() const { return cells_.size() * static_cast<std::size_t>(orientations_); }

  /// The number of a cell among `cells`; −1: the body does not fit, or it is outside.
  std::int32_t number(int x, int y) const {
    return frame_.contains(x, y) ? numbers_[frame_.index(x, y)] : -1;
  }
  /// An orientation may be outside 0 … n−1, by full turns.
  std::size_t index(std::int32_t number, int orientation) const {
    const int wrapped = ((orientation % orientations_) + orientations_) % orientations_;
    return static_cast<std::size_t>(wrapped) * cells_.size() + static_cast<std::size_t>(number);
  }
  std::int32_t number_of(std::size_t configuration) const {
    return static_cast<std::int32_t>(configuration % cells_.size());
  }
  int orientation_of(std::size_t configuration) const {
    return static_cast<int>(configuration / cells_.size());
  }
  /// Of an orientation, in the world [rad].
  double heading(int orientation) const;
  /// The middle of a cell where the body fits [m].
  Eigen::Vector2d position(std::int32_t number) const;
  Pose2 pose(std::size_t configuration) const;
  /// The configuration in whose cell a pose lies; none: the body does not fit there.
  std::optional<std::size_t> nearest(const Pose2& pose) const;

 private:
  GridFrame frame_;
  int orientations_;
  std::vector<std::int32_t> cells_, numbers_;
};

/// By cell of `space.cells()` the length of a path there over neighbouring cells where the body
/// fits, sideways and diagonally [m]; infinity: there is none. A robot that is too near to an
/// obstacle to begin with may leave it, coming no nearer.
CAIRN_API std::vector<float> path_lengths(const ConfigurationSpace& space, const FloorMap& map,
                                          const Eigen::Vector2d& from);

}  // namespace cairn
