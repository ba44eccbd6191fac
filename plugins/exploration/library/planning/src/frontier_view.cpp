// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/frontier_view.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include <fmt/core.h>

#include "beam_sweep.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

using std::numbers::pi;

/// The directions that a lidar with a heading looks along, first … last, in units of β; they may
/// be below 0, and n or more, by full turns.
struct Window {
  int first = 0, last = -1;
};

Window window(const LidarModel& lidar, double heading, int directions) {
  const double beta = 2.0 * pi / directions;
  constexpr double kEdge = 1e-6;  // a beam at the edge of the aperture counts
  Window seen;
  seen.first = static_cast<int>(std::ceil((heading - 0.5 * lidar.aperture) / beta - kEdge));
  seen.last = static_cast<int>(std::floor((heading + 0.5 * lidar.aperture) / beta + kEdge));
  seen.last = std::min(seen.last, seen.first + directions - 1);
  if (seen.last < seen.first)  // a single beam between two directions
    seen.first = seen.last = static_cast<int>(std::lround(heading / beta));
  return seen;
}

int wrapped(int direction, int directions) {
  return ((direction % directions) + directions) % directions;
}

void check(const ConfigurationSpace& space, std::span<const BeamCell> cells, int directions) {
  constexpr int kMostDirections = 2000;  // whose sum a counter holds
  if (directions < 4 || directions > kMostDirections) {
    throw Error(ErrorCode::usage,
                fmt::format("beams have 4 to {} directions, not {}", kMostDirections, directions));
  }
  if (cells.size() != static_cast<std::size_t>(space.frame().size())) {
    throw Error(ErrorCode::usage, fmt::format("{} cells for beams were given for a map of {}",
                                              cells.size(), space.frame().size()));
  }
}

BeamSweep make_sweep(const ConfigurationSpace& space, const LidarModel& lidar, int directions,
                     int unit) {
  return {std::tan(2.0 * pi / directions), lidar.range / space.frame().resolution, unit};
}

/// Of one direction in the grid, which may be turned.
SweepDirection direction_of(const ConfigurationSpace& space, int direction, int directions) {
  return SweepDirection(2.0 * pi * direction / directions - space.frame().yaw);
}

/// Sums over the directions before one of them, by cell: over rows and over columns, which are
/// swept in another order of the cells.
class DirectionSums {
 public:
  DirectionSums(const ConfigurationSpace& space, std::span<const BeamCell> cells, BeamSweep sweep)
      : space_(space),
        sweep_(std::move(sweep)),
        rows_{space.frame(), cells, true},
        columns_{space.frame(), cells, false},
        row_sum_(cells.size()),
        column_sum_(cells.size()) {}

  void add(const SweepDirection& direction) {
    const SweepPlane& plane = direction.by_rows ? rows_ : columns_;
    // Corners are the same for an eighth of the circle.
    if (!corners_ || by_rows_ != direction.by_rows || step_ != direction.step ||
        lean_ != direction.lean) {
      corners_ = std::make_unique<SweepCorners>(plane, direction.step, direction.lean);
      by_rows_ = direction.by_rows;
      step_ = direction.step;
      lean_ = direction.lean;
    }
    sweep_.add(plane, *corners_, direction, direction.by_rows ? row_sum_ : column_sum_);
  }

  /// Adds the sums, or subtracts them, for the cells where the body fits.
  template <bool adds>
  void put(std::span<std::int32_t> counts) const {
    const std::vector<std::int32_t>& cells = space_.cells();
    const auto width = static_cast<std::uint32_t>(space_.frame().width);
    const auto height = static_cast<std::size_t>(space_.frame().height);
    std::uint32_t y = 0, row = 0;  // cells rise
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const auto cell = static_cast<std::uint32_t>(cells[k]);
      while (cell >= row + width) {
        row += width;
        ++y;
      }
      const std::uint32_t sum = row_sum_[cell] + column_sum_[(cell - row) * height + y];
      const auto before = static_cast<std::uint32_t>(counts[k]);
      counts[k] = static_cast<std::int32_t>(adds ? before + sum : before - sum);
    }
  }

 private:
  const ConfigurationSpace& space_;
  BeamSweep sweep_;
  SweepPlane rows_, columns_;
  std::vector<std::uint32_t> row_sum_, column_sum_;
  std::unique_ptr<SweepCorners> corners_;
  bool by_rows_ = false;
  int step_ = 0, lean_ = 0;
};

}  // namespace

std::vector<BeamCell> beam_cells(const FloorMap& map) {
  std::vector<BeamCell> cells(map.cells.size(), BeamCell::opaque);
  for (std::size_t k = 0; k < cells.size(); ++k)
    if (map.cells[k] == CellState::free) cells[k] = BeamCell::open;
  for (const Frontier& frontier : map.frontiers)
    for (const std::int32_t cell : frontier.cells)
      cells[static_cast<std::size_t>(cell)] = BeamCell::frontier;
  return cells;
}

FrontierView::FrontierView(const ConfigurationSpace& space, std::span<const BeamCell> cells,
                           const LidarModel& lidar, int directions) {
  check(space, cells, directions);
  counts_.resize(space.size());
  const std::size_t layer = space.cells().size();
  if (layer == 0) return;
  const auto counts = [&](int orientation) {
    return std::span(counts_).subspan(space.index(0, orientation), layer);
  };
  std::vector<Window> windows;
  for (int k = 0; k < space.orientations(); ++k)
    windows.push_back(window(lidar, space.heading(k), directions));
  DirectionSums sums(space, cells, make_sweep(space, lidar, directions, 1 << 20));
  for (int direction = 0; direction < directions; ++direction) {
    for (int k = 0; k < space.orientations(); ++k) {
      const Window& seen = windows[static_cast<std::size_t>(k)];
      if (direction > 0 && wrapped(seen.first, directions) == direction) sums.put<false>(counts(k));
    }
    sums.add(direction_of(space, direction, directions));
    for (int k = 0; k < space.orientations(); ++k) {
      const Window& seen = windows[static_cast<std::size_t>(k)];
      if (wrapped(seen.last, directions) == direction) sums.put<true>(counts(k));
    }
  }
  for (int k = 0; k < space.orientations(); ++k) {  // round the end of the circle
    const Window& seen = windows[static_cast<std::size_t>(k)];
    if (wrapped(seen.first, directions) > wrapped(seen.last, directions)) sums.put<true>(counts(k));
  }
}

std::vector<SeenFrontier> frontiers_seen_from(const ConfigurationSpace& space,
                                              std::span<const BeamCell> cells,
                                              const LidarModel& lidar, int directions,
                                              std::size_t configuration) {
  check(space, cells, directions);
  const GridFrame& frame = space.frame();
  const BeamSweep sweep = make_sweep(space, lidar, directions, 1);
  const Window seen = window(lidar, space.heading(space.orientation_of(configuration)), directions);
  const std::int32_t cell = space.cells()[static_cast<std::size_t>(space.number_of(configuration))];
  const auto state = [&](int x, int y) {
    return frame.contains(x, y) ? cells[frame.index(x, y)] : BeamCell::opaque;
  };
  std::vector<SeenFrontier> found;
  for (int k = seen.first; k <= seen.last; ++k) {
    const SweepDirection beam = direction_of(space, wrapped(k, directions), directions);
    int x = cell % frame.width, y = cell / frame.width;
    const auto meets = [&](int at_x, int at_y, int steps) {
      const double part = sweep.part(beam, steps);
      if (part > 0.0) found.push_back({static_cast<std::int32_t>(frame.index(at_x, at_y)), part});
    };
    if (state(x, y) != BeamCell::open) continue;
    for (int steps = 1;; ++steps) {
      const int shift = beam.shift(beam.by_rows ? y : x);
      const int dx = beam.by_rows ? shift : beam.step, dy = beam.by_rows ? beam.step : shift;
      const BeamCell side_x = state(x + dx, y), side_y = state(x, y + dy);
      if (shift != 0 && side_x != BeamCell::open && side_y != BeamCell::open) {
        if (side_x == BeamCell::frontier)
          meets(x + dx, y, steps);
        else if (side_y == BeamCell::frontier)
          meets(x, y + dy, steps);
        break;
      }
      x += dx;
      y += dy;
      if (state(x, y) == BeamCell::open) continue;
      if (state(x, y) == BeamCell::frontier) meets(x, y, steps);
      break;
    }
  }
  return found;
}

}  // namespace cairn
