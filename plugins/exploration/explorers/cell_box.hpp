// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace cairn::exploration {

/// A rectangle of cells, [low, high) in both axes; empty unless low < high.
struct CellBox {
  Eigen::Vector2i low = Eigen::Vector2i::Zero(), high = Eigen::Vector2i::Zero();

  bool empty() const { return (low.array() >= high.array()).any(); }
  int width() const { return high.x() - low.x(); }
  int height() const { return high.y() - low.y(); }

  /// The smallest one with all cells of both.
  CellBox with(const CellBox& other) const {
    if (empty()) return other;
    if (other.empty()) return *this;
    return {low.cwiseMin(other.low), high.cwiseMax(other.high)};
  }
  CellBox with(const Eigen::Vector2i& cell) const {
    return with(CellBox{cell, cell + Eigen::Vector2i::Ones()});
  }
  CellBox within(const CellBox& other) const {
    return {low.cwiseMax(other.low), high.cwiseMin(other.high)};
  }
  /// By so many cells on each side; an empty one stays so.
  CellBox grown(int cells) const {
    const Eigen::Vector2i margin = Eigen::Vector2i::Constant(cells);
    return empty() ? *this : CellBox{low - margin, high + margin};
  }
  CellBox moved(const Eigen::Vector2i& by) const { return {low + by, high + by}; }

  /// Row by row.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (int y = low.y(); y < high.y(); ++y) {
      for (int x = low.x(); x < high.x(); ++x) visit(x, y);
    }
  }
};

}  // namespace cairn::exploration
