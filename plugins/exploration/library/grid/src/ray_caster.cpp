// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/ray_caster.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "cairn/runtime/error.hpp"
#include "ray_kernels.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

/// Where a ray crosses the borders of cells along one axis. Lengths are in cells.
struct Crossings {
  Crossings(double from_, int cell_, double direction)
      : step(direction < 0.0 ? -1 : 1),
        border(direction > 0.0 ? cell_ + 1 : cell_),
        from(from_),
        inverse(1.0 / direction),
        crosses(direction != 0.0) {}

  /// The length of the ray at crossing `count` = 1, 2, …
  double at(int count) const {
    return crosses ? (border + step * (count - 1) - from) * inverse
                   : std::numeric_limits<double>::infinity();
  }

  int step, border;
  double from, inverse;
  bool crosses;
};

RayHit stopped_at_once(int x, int y) { return {.range = 0.0, .x = x, .y = y, .hit = true}; }

Vector2d direction_at(double angle) { return {std::cos(angle), std::sin(angle)}; }

}  // namespace

/// Rays from one point: gathered into fans, followed, and their ends computed as traversal does.
class RayCaster::Scan {
 public:
  Scan(const RayCaster& caster, const Start& start, double range, std::span<RayHit> hits)
      : caster_(caster),
        start_(start),
        range_(range),
        length_(range / caster.frame_.resolution),
        hits_(hits) {}

  void add(const Vector2d& direction, std::size_t index) {
    const bool along_x = std::abs(direction.x()) >= std::abs(direction.y());
    const double major = along_x ? direction.x() : direction.y();
    const double minor = along_x ? direction.y() : direction.x();
    const double inverse = 1.0 / major, slope = minor * std::abs(inverse);
    const int sector = (along_x ? 0 : 2) + (major < 0.0 ? 1 : 0);
    if (sector != sector_) begin(sector);
    if (fan_.lines > RayFan::kMostLines || !(std::abs(slope) <= RayFan::kSteepest)) {
      hits_[index] = caster_.traverse(start_, direction, range_);
      return;
    }
    if (fan_.count == RayFan::kLanes || !fits(slope)) flush();
    const int lane = fan_.count++;
    if (lane == 0) least_ = greatest_ = slope;
    if (slope <= least_) fan_.lowest = lane;
    least_ = std::min(least_, slope);
    greatest_ = std::max(greatest_, slope);
    fan_.minor[lane] = minor;
    fan_.inverse[lane] = inverse;
    fan_.slope[lane] = slope;
    rays_[static_cast<std::size_t>(lane)] = {major, index};
  }

  void flush() {
    if (fan_.count == 0) return;
    caster_.follow_(fan_, ends_);
    for (int lane = 0; lane < fan_.count; ++lane)
      hits_[rays_[static_cast<std::size_t>(lane)].index] = hit(lane);
    fan_.count = 0;
  }

 private:
  struct Ray {
    double major;  ///< component of the direction across the lines
    std::size_t index;
  };

  bool fits(double slope) const {
    return fan_.count == 0 ||
           (std::max(greatest_, slope) - std::min(least_, slope)) * fan_.lines <= RayFan::kWidest;
  }

  void begin(int sector) {
    flush();
    sector_ = sector;
    fan_.rows = sector >= 2;
    fan_.step = sector % 2 == 0 ? 1 : -1;
    const Lines& lines = fan_.rows ? caster_.rows_ : caster_.columns_;
    first_line_ = fan_.rows ? start_.y : start_.x;
    fan_.across = fan_.rows ? start_.at.y() : start_.at.x();
    fan_.along = fan_.rows ? start_.at.x() : start_.at.y();
    fan_.cell = fan_.rows ? start_.x : start_.y;
    fan_.border = first_line_ + (fan_.step > 0 ? 1 : 0);
    fan_.bits = lines.bits.data() + lines.byte(first_line_, -RayFan::kMargin);
    fan_.stride = fan_.step * lines.stride;
    // As many lines as there are up to the one that closes the grid, or some more than are within
    // the range.
    const int size = fan_.rows ? caster_.frame_.height : caster_.frame_.width;
    const double to_end = fan_.step > 0 ? size - first_line_ + 1 : first_line_ + 2;
    fan_.lines = static_cast<int>(std::min(to_end, std::floor(length_) + 3.0));
  }

  RayHit hit(int lane) const {
    if (ends_.line[lane] >= fan_.lines) return {.range = range_};
    const double length = ends_.length[lane];
    const int line = first_line_ + fan_.step * static_cast<int>(ends_.line[lane]);
    const int cell = static_cast<int>(ends_.cell[lane]);
    if (ends_.sure[lane] == 0) {
      const double major = rays_[static_cast<std::size_t>(lane)].major, minor = fan_.minor[lane];
      return caster_.traverse(start_, fan_.rows ? Vector2d(minor, major) : Vector2d(major, minor),
                              range_);
    }
    if (!(length <= length_)) return {.range = range_};
    return {.range = length * caster_.frame_.resolution,
            .x = fan_.rows ? cell : line,
            .y = fan_.rows ? line : cell,
            .hit = true};
  }

  const RayCaster& caster_;
  const Start& start_;
  double range_;   // [m]
  double length_;  // the same in cells
  std::span<RayHit> hits_;

  int sector_ = -1, first_line_ = 0;
  RayFan fan_{};  // the rays that are being gathered
  RayEnds ends_{};
  std::array<Ray, RayFan::kLanes> rays_{};
  double least_ = 0.0, greatest_ = 0.0;  // slopes
};

// Words are read from any byte of the cells and of one margin.
RayCaster::Lines::Lines(int count, int size)
    : stride((size + 2 * RayFan::kMargin) / 8 + 8),
      bits((static_cast<std::size_t>(count) + 2 * kLinesAround) * static_cast<std::size_t>(stride),
           0xFF) {}

RayCaster::RayCaster(const OccupancyGrid& grid, const CellThresholds& thresholds,
                     std::string_view kernels)
    : frame_(grid.frame), follow_(choose_ray_kernel(kernels)) {
  static_assert(Lines::kMargin == RayFan::kMargin && Lines::kLinesAround >= RayFan::kAtOnce);
  check_frame(frame_, "ray casting");
  if (!follow_)
    throw Error(ErrorCode::usage, "ray casting: there are no kernels '" + std::string(kernels) +
                                      "' on this machine; 'portable' and 'auto' always are");
  columns_ = Lines(frame_.width, frame_.height);
  rows_ = Lines(frame_.height, frame_.width);
  for (int y = 0; y < frame_.height; ++y) {
    for (int x = 0; x < frame_.width; ++x) {
      if (thresholds.state(grid.occupancy[frame_.index(x, y)]) != CellState::free) continue;
      columns_.clear(x, y);
      rows_.clear(y, x);
    }
  }
}

template <class Cast>
void RayCaster::each(const Vector2d& from, double heading, std::span<const Vector2d> beams,
                     double range, std::span<RayHit> hits, Cast&& cast) const {
  if (hits.size() != beams.size())
    throw Error(ErrorCode::usage, "ray casting: there are not as many hits as beams");
  const Start start = start_at(from, range, heading);
  if (start.ends) {
    std::ranges::fill(hits, *start.ends);
    return;
  }
  const Vector2d turn = direction_at(heading - frame_.yaw);
  const auto direction = [&](const Vector2d& beam) {
    return Vector2d(turn.x() * beam.x() - turn.y() * beam.y(),
                    turn.y() * beam.x() + turn.x() * beam.y());
  };
  cast(start, direction);
}

void RayCaster::cast(const Vector2d& from, double heading, std::span<const Vector2d> beams,
                     double range, std::span<RayHit> hits) const {
  each(from, heading, beams, range, hits, [&](const Start& start, const auto& direction) {
    Scan scan(*this, start, range, hits);
    for (std::size_t k = 0; k < beams.size(); ++k) scan.add(direction(beams[k]), k);
    scan.flush();
  });
}

void RayCaster::cast_plainly(const Vector2d& from, double heading, std::span<const Vector2d> beams,
                             double range, std::span<RayHit> hits) const {
  each(from, heading, beams, range, hits, [&](const Start& start, const auto& direction) {
    for (std::size_t k = 0; k < beams.size(); ++k)
      hits[k] = traverse(start, direction(beams[k]), range);
  });
}

RayHit RayCaster::cast(const Vector2d& from, double angle, double range) const {
  const Start start = start_at(from, range, angle);
  return start.ends ? *start.ends : traverse(start, direction_at(angle - frame_.yaw), range);
}

RayCaster::Start RayCaster::start_at(const Vector2d& from, double range, double angle) const {
  // Farther away there are no cells, and numbers of cells are no integers any more.
  constexpr double kFar = 1e9;
  Start start{.at = frame_.to_cells(from), .ends = {}};
  if (!(start.at.array().abs() < kFar).all() || !std::isfinite(angle)) {
    start.ends = stopped_at_once(-1, -1);
    return start;
  }
  start.x = static_cast<int>(std::floor(start.at.x()));
  start.y = static_cast<int>(std::floor(start.at.y()));
  if (!frame_.contains(start.x, start.y) || rows_.has(start.y, start.x)) {
    start.ends = stopped_at_once(start.x, start.y);
  } else if (!(range >= 0.0)) {
    start.ends = RayHit{.range = range};
  }
  return start;
}

RayHit RayCaster::traverse(const Start& start, const Vector2d& direction, double range) const {
  const double length = range / frame_.resolution;
  const Crossings along_x(start.at.x(), start.x, direction.x());
  const Crossings along_y(start.at.y(), start.y, direction.y());
  int x = start.x, y = start.y, m = 1, n = 1;
  double at = 0.0, next_x = along_x.at(m), next_y = along_y.at(n);
  while (!rows_.has(y, x)) {
    if (next_x <= next_y) {
      at = next_x;
      x += along_x.step;
      next_x = along_x.at(++m);
    } else {
      at = next_y;
      y += along_y.step;
      next_y = along_y.at(++n);
    }
    if (!(at <= length)) return {.range = range};
  }
  return {.range = at * frame_.resolution, .x = x, .y = y, .hit = true};
}

}  // namespace cairn
