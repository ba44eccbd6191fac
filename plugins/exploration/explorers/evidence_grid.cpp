// SPDX-License-Identifier: BSD-3-Clause
#include "evidence_grid.hpp"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "cairn/grid/cell_traversal.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::exploration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;

constexpr int kMargin = 20;  // cells, so that it does not grow with every scan
constexpr double kMostCells = 1e8;

void check_size(const Vector2i& size, double resolution) {
  if (double(size.x()) * size.y() <= kMostCells) return;
  throw Error(ErrorCode::input,
              fmt::format("with it the map has {} × {} cells of {:g} m, expected at most {:g}; if "
                          "its pose is right, larger cells (resolution=)",
                          size.x(), size.y(), resolution, kMostCells));
}

}  // namespace

void EvidenceGrid::cover(const Vector2d& low, const Vector2d& high) {
  const double side = frame_.resolution;
  constexpr double kFar = 1e6;  // cells, of which 10⁸ are most
  if (!(low.array() > -kFar * side).all() || !(high.array() < kFar * side).all()) {
    throw Error(
        ErrorCode::input,
        fmt::format("that is not finite, or more than {:g} m from the origin", kFar * side));
  }
  Vector2i first = (low / side).array().floor().cast<int>();
  Vector2i last = (high / side).array().floor().cast<int>();
  const Vector2i size(frame_.width, frame_.height);
  if (frame_.width > 0) {
    if ((first.array() >= first_.array()).all() && (last.array() < (first_ + size).array()).all())
      return;
    first = first.cwiseMin(first_);
    last = last.cwiseMax(first_ + size - Vector2i::Ones());
  }
  const Vector2i margin = Vector2i::Constant(kMargin);
  grow(first - margin, last + margin);
}

void EvidenceGrid::count(const Vector2d& from, const std::vector<BeamEnd>& ends, int change) {
  if (scan_ == std::numeric_limits<std::uint32_t>::max()) {
    std::ranges::fill(marked_, 0U);
    scan_ = 0;
  }
  ++scan_;
  CellBox touched = CellBox{}.with(Vector2i(from.array().floor().cast<int>()));
  for (const BeamEnd& end : ends) {
    const Vector2i cell = end.cell();
    touched = touched.with(cell);
    if (!end.hit) continue;
    if (Evidence* there = unmarked(cell.x(), cell.y())) there->hits += change;
  }
  for (const BeamEnd& end : ends) {
    traverse_cells(from, end.at, [&](int x, int y) {
      if (Evidence* cell = unmarked(x, y)) cell->misses += change;
      return true;
    });
  }
  // Rounding may lead a beam past a corner of the box.
  changed_ = changed_.with(touched.grown(1));
}

void EvidenceGrid::clear() {
  std::ranges::fill(evidence_, Evidence{});
  changed_ = world_box();
}

/// The cell, if this scan has not been there, and marks it.
Evidence* EvidenceGrid::unmarked(int world_x, int world_y) {
  const int x = world_x - first_.x(), y = world_y - first_.y();
  if (!frame_.contains(x, y)) return nullptr;
  const std::size_t index = frame_.index(x, y);
  if (std::exchange(marked_[index], scan_) == scan_) return nullptr;
  return &evidence_[index];
}

void EvidenceGrid::grow(const Vector2i& first, const Vector2i& last) {
  GridFrame frame = frame_;
  const Vector2i size = last - first + Vector2i::Ones();
  check_size(size, frame.resolution);
  frame.width = size.x();
  frame.height = size.y();
  frame.origin = first.cast<double>() * frame.resolution;
  std::vector<Evidence> evidence(static_cast<std::size_t>(frame.size()));
  const Vector2i shift = first_ - first;
  for (int y = 0; y < frame_.height; ++y) {
    std::copy_n(&evidence_[frame_.index(0, y)], frame_.width,
                &evidence[frame.index(shift.x(), y + shift.y())]);
  }
  evidence_ = std::move(evidence);
  marked_.assign(evidence_.size(), 0);
  scan_ = 0;
  frame_ = frame;
  first_ = first;
}

}  // namespace cairn::exploration
