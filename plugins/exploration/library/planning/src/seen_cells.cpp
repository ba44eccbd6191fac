// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/seen_cells.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

namespace cairn {
namespace {

using Eigen::Vector2d;

constexpr int kWordBits = 64;

std::size_t word_at(int words_per_row, int row, int word) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(words_per_row) +
         static_cast<std::size_t>(word);
}

std::uint64_t bit_of(int x) { return std::uint64_t{1} << (static_cast<unsigned>(x) % kWordBits); }

/// Where a ray crosses the borders of cells along one axis, in cells from its start, once it is in
/// a cell. The borders are computed as `RayCaster` does, so that both enter the same cells.
struct Crossings {
  Crossings() = default;
  Crossings(double from, double direction, int cell_)
      : cell(cell_),
        border(direction > 0.0 ? cell + 1.0 : cell),
        inverse(1.0 / direction),
        start(from),
        cells{0, direction < 0.0 ? -1 : 1},
        borders{0.0, direction < 0.0 ? -1.0 : 1.0} {
    if (direction != 0.0) return;
    // None, however often it is asked.
    border = 1.0;
    start = 0.0;
    inverse = std::numeric_limits<double>::infinity();
    cells[1] = 0;
    borders[1] = 0.0;
  }
  double next() const { return (border - start) * inverse; }
  /// By 1 step or none, without a branch: which axis is next can't be foretold.
  void advance(std::size_t steps) {
    cell += cells[steps];
    border += borders[steps];
  }

  int cell = 0;
  double border = 0.0, inverse = 0.0, start = 0.0;
  std::array<int, 2> cells{};  ///< by which it moves with none and with 1 step
  std::array<double, 2> borders{};
};

}  // namespace

CellSet::CellSet(int rows, int words_per_row)
    : words_per_row_(words_per_row),
      bits_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(words_per_row), 0) {}

bool CellSet::contains(int x, int y) const {
  return (bits_[word_at(words_per_row_, y, x / kWordBits)] & bit_of(x)) != 0;
}

template <class Visit>
void CellSet::for_each_word(const CellWindow& window, Visit&& visit) const {
  if (window.empty()) return;
  const std::uint64_t* bits = window.bits.data();
  for (int row = 0; row < window.rows; ++row) {
    std::size_t at = word_at(words_per_row_, window.first_row + row, window.first_word);
    for (int word = 0; word < window.words; ++word) visit(at++, *bits++);
  }
}

std::size_t CellSet::missing(const CellWindow& window) const {
  std::size_t count = 0;
  for_each_word(window, [&](std::size_t at, std::uint64_t bits) {
    count += static_cast<std::size_t>(std::popcount(bits & ~bits_[at]));
  });
  return count;
}

void CellSet::add(const CellWindow& window) {
  for_each_word(window, [&](std::size_t at, std::uint64_t bits) {
    count_ += static_cast<std::size_t>(std::popcount(bits & ~bits_[at]));
    bits_[at] |= bits;
  });
}

SeenCells::SeenCells(const FloorMap& map, const LidarModel& lidar, double range)
    : reach_(range), range_(range / map.frame.resolution) {
  const int margin = static_cast<int>(std::ceil(range_)) + 1;
  frame_ = map.frame;
  frame_.width += 2 * margin;
  frame_.height += 2 * margin;
  frame_.origin = map.frame.to_world(Vector2d::Constant(-margin));
  words_ = (frame_.width + kWordBits - 1) / kWordBits;
  const auto size = static_cast<std::size_t>(frame_.height) * static_cast<std::size_t>(words_);
  unknown_.assign(size, ~std::uint64_t{0});
  obstacles_.assign(size, 0);
  OccupancyGrid floor{frame_, std::vector<std::int8_t>(frame_.size(), kUnknownCell)};
  for (int y = 0; y < map.frame.height; ++y) {
    for (int x = 0; x < map.frame.width; ++x) {
      const CellState state = map.cells[map.frame.index(x, y)];
      const std::size_t at = word_at(words_, y + margin, (x + margin) / kWordBits);
      if (state != CellState::unknown) unknown_[at] &= ~bit_of(x + margin);
      if (state == CellState::occupied) obstacles_[at] |= bit_of(x + margin);
      if (state == CellState::free) floor.occupancy[frame_.index(x + margin, y + margin)] = 0;
    }
  }
  // The bits of a row's last word that are no cells.
  if (const int rest = frame_.width % kWordBits; rest > 0) {
    for (int y = 0; y < frame_.height; ++y) {
      const std::size_t last = word_at(words_, y, words_ - 1);
      unknown_[last] &= bit_of(rest) - 1;
      obstacles_[last] |= ~(bit_of(rest) - 1);
    }
  }
  floor_.emplace(floor);
  beams_ = beam_directions(lidar);
  find_viewpoints();
}

/// A beam enters cells by their sides, at most √2 range + 2 of them: no cell that is farther from
/// all unknown ones, over cells that are no obstacles, sees any. (Most known floor does not.)
void SeenCells::find_viewpoints() {
  const int most = static_cast<int>(std::numbers::sqrt2 * range_) + 2;
  viewpoints_ = unknown_;
  std::vector<std::uint64_t> before;
  bool grows = true;
  for (int steps = 0; steps < most && grows; ++steps) {
    before = viewpoints_;
    grows = false;
    for (int y = 0; y < frame_.height; ++y) {
      for (int word = 0; word < words_; ++word) {
        const std::size_t at = word_at(words_, y, word);
        std::uint64_t beside = (before[at] << 1) | (before[at] >> 1);
        if (word > 0) beside |= before[at - 1] >> (kWordBits - 1);
        if (word + 1 < words_) beside |= before[at + 1] << (kWordBits - 1);
        if (y > 0) beside |= before[word_at(words_, y - 1, word)];
        if (y + 1 < frame_.height) beside |= before[word_at(words_, y + 1, word)];
        viewpoints_[at] |= beside & ~obstacles_[at];
        grows = grows || viewpoints_[at] != before[at];
      }
    }
  }
}

void SeenCells::leave_out(std::span<const Vector2d> points) {
  for (const Vector2d& point : points) {
    const Vector2d cell = frame_.to_cells(point).array().floor();
    const int x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
    if (frame_.contains(x, y)) unknown_[word_at(words_, y, x / kWordBits)] &= ~bit_of(x);
  }
  if (!points.empty()) find_viewpoints();
}

std::vector<Vector2d> SeenCells::middles(const CellSet& cells) const {
  std::vector<Vector2d> points;
  points.reserve(cells.count());
  for (int y = 0; y < frame_.height; ++y) {
    for (int x = 0; x < frame_.width; ++x) {
      if (cells.contains(x, y)) points.push_back(frame_.centre(x, y));
    }
  }
  return points;
}

CellWindow SeenCells::look(std::span<const Pose2> poses) const {
  const auto sees_nothing = [&](const Pose2& pose) {
    const Vector2d cell = frame_.to_cells(pose.translation()).array().floor();
    const int x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
    return !frame_.contains(x, y) ||
           (viewpoints_[word_at(words_, y, x / kWordBits)] & bit_of(x)) == 0;
  };
  if (std::ranges::all_of(poses, sees_nothing)) return {};
  CellWindow seen = window_around(poses);
  std::vector<RayHit> hits(beams_.size());
  for (const Pose2& pose : poses) cast(pose, hits, seen);
  if (std::ranges::all_of(seen.bits, [](std::uint64_t word) { return word == 0; })) return {};
  return seen;
}

CellWindow SeenCells::window_around(std::span<const Pose2> poses) const {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Pose2& pose : poses) {
    const Vector2d at = frame_.to_cells(pose.translation());
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  const auto within = [](double value, int size) {
    return static_cast<int>(std::clamp(std::floor(value), 0.0, size - 1.0));
  };
  CellWindow window;
  window.first_row = within(low.y() - range_ - 1.0, frame_.height);
  window.rows = within(high.y() + range_, frame_.height) - window.first_row + 1;
  window.first_word = within(low.x() - range_ - 1.0, frame_.width) / kWordBits;
  window.words = within(high.x() + range_, frame_.width) / kWordBits - window.first_word + 1;
  window.bits.assign(word_at(window.words, window.rows, 0), 0);
  return window;
}

void SeenCells::cast(const Pose2& at, std::span<RayHit> hits, CellWindow& seen) const {
  const Vector2d from = frame_.to_cells(at.translation());
  const bool on_map = from.x() > range_ && from.y() > range_ && from.x() < frame_.width - range_ &&
                      from.y() < frame_.height - range_;
  if (!on_map) return;
  const int start_x = static_cast<int>(from.x()), start_y = static_cast<int>(from.y());
  const std::size_t start = word_at(words_, start_y, start_x / kWordBits);
  if ((viewpoints_[start] & bit_of(start_x)) == 0) return;
  floor_->cast(at.translation(), at.theta(), beams_, reach_, hits);
  mark(from, at.theta() - frame_.yaw, hits, seen);
}

/// The unknown ones of the cells that the beams enter, each from the cell on where it has hit. Some
/// beams take turns: each step of one waits for the numbers of the step before.
void SeenCells::mark(const Vector2d& from, double turn, std::span<const RayHit> hits,
                     CellWindow& seen) const {
  struct Ray {
    Crossings along_x, along_y;
  };
  const double c = std::cos(turn), s = std::sin(turn);
  std::size_t next = 0;
  const auto start = [&](Ray& ray) {
    while (next < hits.size() && !hits[next].hit) ++next;
    if (next == hits.size()) return false;
    const Vector2d& beam = beams_[next];
    ray = {{from.x(), c * beam.x() - s * beam.y(), hits[next].x},
           {from.y(), s * beam.x() + c * beam.y(), hits[next].y}};
    ++next;
    return true;
  };
  const auto enter = [&](Ray& ray) {
    const int x = ray.along_x.cell, y = ray.along_y.cell;
    const std::size_t word = word_at(words_, y, x / kWordBits);
    const std::uint64_t bit = bit_of(x);
    if ((obstacles_[word] & bit) != 0) return false;
    seen.bits[word_at(seen.words, y - seen.first_row, x / kWordBits - seen.first_word)] |=
        unknown_[word] & bit;
    const double next_x = ray.along_x.next(), next_y = ray.along_y.next();
    const std::size_t crosses_x = next_x <= next_y ? 1 : 0;
    ray.along_x.advance(crosses_x);
    ray.along_y.advance(1 - crosses_x);
    return std::min(next_x, next_y) <= range_;
  };
  constexpr std::size_t kAtOnce = 4;
  std::array<Ray, kAtOnce> rays;
  std::size_t count = 0;
  while (count < kAtOnce && start(rays[count])) ++count;
  while (count > 0) {
    for (std::size_t k = 0; k < count;) {
      if (enter(rays[k]) || start(rays[k]))
        ++k;
      else
        rays[k] = rays[--count];
    }
  }
}

double SeenCells::entropy_change(std::size_t cells) const {
  return -frame_.cell_area() * std::numbers::ln2 * static_cast<double>(cells);
}

}  // namespace cairn
