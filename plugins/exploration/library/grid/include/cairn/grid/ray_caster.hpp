// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

struct RayFan;
struct RayEnds;

/// What a ray meets.
struct RayHit {
  double range = 0.0;  ///< [m] to where it enters the cell, or as far as it was cast
  int x = 0, y = 0;    ///< the cell that stops it: the first one outside, if it leaves the grid
  bool hit = false;    ///< false: nothing stops it within the range
};

/// Rays over the cells of a grid, as a lidar's. Every cell that is not free stops them, and so does
/// what lies outside the grid. Cell and range are those of exact traversal, to the last bit, which
/// visits each cell that the ray enters, in order (Amanatides and Woo 1987; through a corner it
/// goes along x first). But rays are followed column by column, or row by row where they are
/// steeper, several side by side: their positions in the next column are sums in fixed point, and
/// the cells of a column are the bits of a word that is the same for all of them. A ray that such a
/// sum puts into a cell that stops it, or closer to one than the error of the sum, is computed
/// again in floating point, with the comparisons of exact traversal.
class CAIRN_API RayCaster {
 public:
  /// Time per cell, and 2 bits of memory. `kernels`: by default the fastest that the machine can
  /// run; or avx512, avx2 or portable, which differ in speed alone. Throws `Error` (input) as
  /// `check_frame` does, and (usage) for kernels that the machine cannot run.
  explicit RayCaster(const OccupancyGrid& grid, const CellThresholds& thresholds = {},
                     std::string_view kernels = "auto");

  /// The rays of a scan: from a point of the world [m], along unit vectors that are turned by
  /// `heading` [rad], up to `range` [m]; a `RayHit` for each. Fastest in the order of their angles.
  /// Where that point is not on the grid, or is no number, the rays are stopped at once. Throws
  /// `Error` (usage) if the numbers of beams and of hits differ.
  void cast(const Eigen::Vector2d& from, double heading, std::span<const Eigen::Vector2d> beams,
            double range, std::span<RayHit> hits) const;
  /// The same, cell by cell: to compare with.
  void cast_plainly(const Eigen::Vector2d& from, double heading,
                    std::span<const Eigen::Vector2d> beams, double range,
                    std::span<RayHit> hits) const;
  /// One ray, cell by cell, at an angle to the world's x axis [rad].
  RayHit cast(const Eigen::Vector2d& from, double angle, double range) const;

 private:
  class Scan;
  /// Columns or rows of cells as bits, 1 for a cell that stops rays, with a margin of such cells
  /// all around.
  struct Lines {
    static constexpr int kMargin = 128, kLinesAround = 8;
    Lines() = default;
    Lines(int count, int size);
    std::ptrdiff_t byte(int line, int cell) const {
      return (line + kLinesAround) * stride + (cell + kMargin) / 8;
    }
    bool has(int line, int cell) const {
      return (bits[static_cast<std::size_t>(byte(line, cell))] >> bit(cell) & 1U) != 0;
    }
    void clear(int line, int cell) {
      bits[static_cast<std::size_t>(byte(line, cell))] &=
          static_cast<std::uint8_t>(~(1U << bit(cell)));
    }
    static unsigned bit(int cell) { return static_cast<unsigned>(cell) % 8U; }

    std::ptrdiff_t stride = 0;  ///< of a line [bytes]
    std::vector<std::uint8_t> bits;
  };
  struct Start {
    Eigen::Vector2d at;          ///< [cells]
    int x = 0, y = 0;            ///< the cell that holds it
    std::optional<RayHit> ends;  ///< what becomes of all rays, where they are stopped at once
  };

  Start start_at(const Eigen::Vector2d& from, double range, double angle) const;
  RayHit traverse(const Start& start, const Eigen::Vector2d& direction, double range) const;
  template <class Cast>
  void each(const Eigen::Vector2d& from, double heading, std::span<const Eigen::Vector2d> beams,
            double range, std::span<RayHit> hits, Cast&& cast) const;

  GridFrame frame_;
  Lines columns_, rows_;
  void (*follow_)(const RayFan&, RayEnds&) = nullptr;
};

}  // namespace cairn
