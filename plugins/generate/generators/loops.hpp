// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <vector>

#include "random.hpp"
#include "rigid.hpp"

namespace cairn::generate {

/// A loop closure: pose `later` sees that it is near pose `earlier`.
struct Loop {
  int earlier;
  int later;
};

/// Which pairs of poses close a loop.
struct LoopRule {
  double radius = 2.0;                         ///< nearer than this [m]
  double probability = 1.0;                    ///< of a pair within reach
  int most = std::numeric_limits<int>::max();  ///< loops that one pose closes with earlier ones
  int gap = 10;                                ///< at least so many poses apart along the path
  double max_angle = std::numeric_limits<double>::infinity();  ///< between the orientations [rad]
  /// Poses remembered a cell (a cube of side `radius`); where more came by, a random sample of
  /// them. Bounds the search by a constant a pose, however often the robot comes back. 0: all.
  int cell_capacity = 0;
};

/// Points by the cell of a regular grid that they lie in: neighbours are found in constant time.
class CellGrid {
 public:
  CellGrid(double cell, int capacity) : cell_(cell), capacity_(capacity) {}

  /// Adds a point. In a full cell it takes the place of one of those before it, or of none, so that
  /// all that ever came are kept with equal probability (reservoir sampling; Vitter 1985).
  void add(int index, const std::array<double, 3>& at, Random& random);

  /// Calls `visit(index)` for the points in the cells around `at`, in a fixed order.
  template <class Visit>
  void around(const std::array<double, 3>& at, Visit visit) const {
    const std::array<std::int64_t, 3> c = cell_of(at);
    for (std::int64_t dz = -1; dz <= 1; ++dz) {
      for (std::int64_t dy = -1; dy <= 1; ++dy) {
        for (std::int64_t dx = -1; dx <= 1; ++dx) {
          const auto cell = cells_.find(key({c[0] + dx, c[1] + dy, c[2] + dz}));
          if (cell == cells_.end()) continue;
          for (int index : cell->second.points) visit(index);
        }
      }
    }
  }

 private:
  struct Cell {
    std::vector<int> points;
    std::int64_t seen = 0;
  };
  std::array<std::int64_t, 3> cell_of(const std::array<double, 3>& at) const;
  /// 21 bits per coordinate: a world of two million cells along each axis.
  static std::uint64_t key(const std::array<std::int64_t, 3>& c) {
    constexpr std::uint64_t kMask = (1u << 21) - 1;
    return (static_cast<std::uint64_t>(c[0]) & kMask) |
           (static_cast<std::uint64_t>(c[1]) & kMask) << 21 |
           (static_cast<std::uint64_t>(c[2]) & kMask) << 42;
  }

  double cell_;
  int capacity_;
  std::unordered_map<std::uint64_t, Cell> cells_;  // only ever looked up: its order does not matter
};

/// The loop closures of a path, by rising `later`, nearest first, in the order of the trajectory.
/// Time and memory go with the number of poses if `cell_capacity` is given.
template <class Pose>
std::vector<Loop> find_loops(const std::vector<Pose>& path, const LoopRule& rule, Random& random);

}  // namespace cairn::generate
