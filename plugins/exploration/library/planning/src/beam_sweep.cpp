// SPDX-License-Identifier: BSD-3-Clause
#include "beam_sweep.hpp"

#include <algorithm>

namespace cairn {
namespace {

constexpr std::int16_t kAll = -1;

/// A line after the next one: steps to the nearest cell that is not open.
void step_straight(const std::int16_t* next, const std::int16_t* open, const std::int16_t* stop,
                   std::int16_t* steps, int length) {
  for (int k = 0; k < length; ++k) {
    const auto further =
        static_cast<std::int16_t>(std::min<std::int16_t>(next[k], SweepPlane::kNone - 1) + 1);
    steps[k] = static_cast<std::int16_t>((further & open[k]) | stop[k]);
  }
}

/// The same with a shift, past a corner: a beam that does not pass it ends after one step.
void step_past_corners(const std::int16_t* next, const std::int16_t* pass,
                       const std::int16_t* corner, const std::int16_t* open,
                       const std::int16_t* stop, std::int16_t* steps, int length) {
  for (int k = 0; k < length; ++k) {
    const auto met = static_cast<std::int16_t>((next[k] & pass[k]) | corner[k]);
    const auto further =
        static_cast<std::int16_t>(std::min<std::int16_t>(met, SweepPlane::kNone - 1) + 1);
    steps[k] = static_cast<std::int16_t>((further & open[k]) | stop[k]);
  }
}

void add_parts(const std::int16_t* steps, float per_step, float most, int reach,
               std::uint32_t* total, int length) {
  for (int k = 0; k < length; ++k) {
    const int count = steps[k];
    const float part = std::min(static_cast<float>(count) * per_step, most);
    total[k] += static_cast<std::uint32_t>(count <= reach ? static_cast<std::int32_t>(part) : 0);
  }
}

}  // namespace

SweepPlane::SweepPlane(const GridFrame& frame, std::span<const BeamCell> cells, bool rows)
    : by_rows(rows),
      lines(rows ? frame.height : frame.width),
      length(rows ? frame.width : frame.height),
      open(cells.size()),
      stop(cells.size()) {
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const BeamCell cell = cells[frame.index(x, y)];
      const std::size_t to = rows ? at(y, x) : at(x, y);
      open[to] = cell == BeamCell::open ? kAll : std::int16_t{0};
      stop[to] = cell == BeamCell::opaque ? kNone : std::int16_t{0};
    }
  }
}

SweepDirection::SweepDirection(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  by_rows = std::abs(s) > std::abs(c);
  const double ahead = by_rows ? s : c, aside = by_rows ? c : s;
  step = ahead > 0.0 ? 1 : -1;
  lean = aside > 0.0 ? 1 : -1;
  slope = std::abs(aside / ahead);
  length = std::hypot(1.0, slope);
}

SweepCorners::SweepCorners(const SweepPlane& plane, int step, int lean)
    : pass(plane.open.size()), stop(plane.open.size()) {
  for (int line = 0; line < plane.lines; ++line) {
    for (int place = 0; place < plane.length; ++place) {
      const std::size_t at = plane.at(line, place);
      if (plane.is_open(line + step, place) || plane.is_open(line, place + lean)) {
        pass[at] = kAll;
      } else if (!plane.is_frontier(line + step, place) && !plane.is_frontier(line, place + lean)) {
        stop[at] = SweepPlane::kNone;
      }
    }
  }
}

int BeamSweep::reach(const SweepDirection& direction) const {
  const double most = SweepPlane::kNone - 1;
  return static_cast<int>(std::min(std::floor(range_ / direction.length + 1e-9), most));
}

double BeamSweep::part(const SweepDirection& direction, int steps) const {
  if (steps > reach(direction)) return 0.0;
  return std::min(1.0, steps * direction.length * tangent_);
}

void BeamSweep::add(const SweepPlane& plane, const SweepCorners& corners,
                    const SweepDirection& direction, std::span<std::uint32_t> total) {
  const auto padded = static_cast<std::size_t>(plane.length) + 2;
  steps_.assign(padded, SweepPlane::kNone);
  next_.assign(padded, SweepPlane::kNone);
  const auto per_step = static_cast<float>(direction.length * tangent_ * unit_);
  const auto most = static_cast<float>(unit_);
  const int first = direction.step > 0 ? plane.lines - 1 : 0;
  const int reach = this->reach(direction);
  for (int k = 0; k < plane.lines; ++k) {
    const int line = first - direction.step * k;
    const std::size_t at = plane.at(line, 0);
    const int shift = direction.shift(line);
    const std::int16_t* next = next_.data() + 1 + shift;
    std::int16_t* steps = steps_.data() + 1;
    if (shift == 0) {
      step_straight(next, &plane.open[at], &plane.stop[at], steps, plane.length);
    } else {
      step_past_corners(next, &corners.pass[at], &corners.stop[at], &plane.open[at],
                        &plane.stop[at], steps, plane.length);
    }
    add_parts(steps, per_step, most, reach, &total[at], plane.length);
    std::swap(steps_, next_);
  }
}

}  // namespace cairn
