// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/grid/grid.hpp"
#include "cairn/planning/frontier_view.hpp"

namespace cairn {

/// The cells of a map in the order in which a sweep passes them: line by line, a line being a row,
/// or a column. What a beam meets in a cell is a mask and a number of steps, so that the sweep is
/// arithmetic alone.
struct SweepPlane {
  static constexpr std::int16_t kNone = 32000;  ///< steps: no frontier is met

  /// `rows`: lines are rows.
  SweepPlane(const GridFrame& frame, std::span<const BeamCell> cells, bool rows);

  std::size_t at(int line, int place) const {
    return static_cast<std::size_t>(line) * static_cast<std::size_t>(length) +
           static_cast<std::size_t>(place);
  }
  bool contains(int line, int place) const {
    return line >= 0 && line < lines && place >= 0 && place < length;
  }
  bool is_open(int line, int place) const {
    return contains(line, place) && open[at(line, place)] != 0;
  }
  bool is_frontier(int line, int place) const {
    return contains(line, place) && open[at(line, place)] == 0 && stop[at(line, place)] == 0;
  }

  bool by_rows;
  int lines, length;
  std::vector<std::int16_t> open;  ///< all bits where a cell is open, else 0
  std::vector<std::int16_t> stop;  ///< 0 in open cells and frontiers, `kNone` in opaque cells
};

/// A direction of beams on a plane of lines.
struct SweepDirection {
  bool by_rows = true;  ///< lines are rows: the beam is nearer to the y axis than to the x axis
  int step = 1;         ///< to the next line
  int lean = 1;         ///< along the line, where the beam shifts
  double slope = 0.0;   ///< places per line, 0 to 1
  double length = 1.0;  ///< of one step [cells]

  /// `angle`: to the x axis of the grid [rad].
  explicit SweepDirection(double angle);

  /// Along the line from `line` to the next one: 0 or `lean`. The sum over k lines differs from
  /// k times the slope by less than 1.
  int shift(int line) const { return lean * (offset(step * line + 1) - offset(step * line)); }

 private:
  int offset(int progress) const { return static_cast<int>(std::floor(progress * slope + 0.5)); }
};

/// The two cells beside each corner that a step with a shift passes.
struct SweepCorners {
  SweepCorners(const SweepPlane& plane, int step, int lean);
  std::vector<std::int16_t> pass;  ///< all bits where one of the two is open
  std::vector<std::int16_t> stop;  ///< else 0 if one of them is a frontier, or `kNone`
};

/// Adds min(1, r tan β / l) · `unit` of the nearest cell that is not open, in one direction, to all
/// cells where that is a frontier at a distance of at most `range` cells.
class BeamSweep {
 public:
  /// `tangent`: of the angle between directions.
  BeamSweep(double tangent, double range, int unit)
      : tangent_(tangent), range_(range), unit_(unit) {}

  /// `total`: by `SweepPlane::at`.
  void add(const SweepPlane& plane, const SweepCorners& corners, const SweepDirection& direction,
           std::span<std::uint32_t> total);

  /// The part of a frontier that is met after so many steps; 0: out of range.
  double part(const SweepDirection& direction, int steps) const;

 private:
  int reach(const SweepDirection& direction) const;

  double tangent_, range_;
  int unit_;
  std::vector<std::int16_t> steps_, next_;  ///< of a line, with a place before and behind it
};

}  // namespace cairn
