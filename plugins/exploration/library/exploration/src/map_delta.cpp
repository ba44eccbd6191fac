// SPDX-License-Identifier: BSD-3-Clause
#include "map_delta.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <fmt/core.h>

#include "cairn/io/packed_array.hpp"

namespace cairn {
namespace {

constexpr double kOnLattice = 1e-3;  // cells

/// Where cell (0, 0) of `frame` is, in cells of `lattice`.
Eigen::Vector2d place_on(const GridFrame& lattice, const GridFrame& frame) {
  return lattice.to_cells(frame.origin);
}

bool stands_on(const GridFrame& lattice, const GridFrame& frame) {
  if (lattice.resolution != frame.resolution || lattice.yaw != frame.yaw) return false;
  const Eigen::Vector2d place = place_on(lattice, frame);
  return (place - place.array().round().matrix()).cwiseAbs().maxCoeff() < kOnLattice;
}

}  // namespace

std::uint8_t MapDelta::Raster::at(int column, int row) const {
  const int i = column - x, j = row - y;
  if (i < 0 || i >= width || j < 0 || j >= height) return kUnknownByte;
  return cells[static_cast<std::size_t>(j) * static_cast<std::size_t>(width) +
               static_cast<std::size_t>(i)];
}

std::string MapDelta::start_lattice(const GridFrame& frame) {
  lattice_ = frame;
  last_ = {};
  return fmt::format(R"("resolution":{},"origin":[{},{}],"yaw":{},)", json_number(frame.resolution),
                     json_number(frame.origin.x()), json_number(frame.origin.y()),
                     json_number(frame.yaw));
}

std::string MapDelta::changes(const FloorMap& map) {
  const bool fresh = lattice_.resolution == 0.0 || !stands_on(lattice_, map.frame);
  const std::string lattice = fresh ? start_lattice(map.frame) : "";
  const Eigen::Vector2d place = place_on(lattice_, map.frame);
  Raster now{.x = static_cast<int>(std::lround(place.x())),
             .y = static_cast<int>(std::lround(place.y())),
             .width = map.frame.width,
             .height = map.frame.height,
             .cells = {}};
  for (const std::int8_t cell : map.occupancy().occupancy)
    now.cells.push_back(static_cast<std::uint8_t>(cell));
  // The box round the cells that differ, within that of both maps.
  const int left = std::min(now.x, last_.width > 0 ? last_.x : now.x);
  const int low = std::min(now.y, last_.width > 0 ? last_.y : now.y);
  const int right = std::max(now.x + now.width, last_.x + last_.width);
  const int high = std::max(now.y + now.height, last_.y + last_.height);
  int x0 = std::numeric_limits<int>::max(), y0 = x0, x1 = std::numeric_limits<int>::min(), y1 = x1;
  for (int y = low; y < high; ++y) {
    for (int x = left; x < right; ++x) {
      if (now.at(x, y) == last_.at(x, y)) continue;
      x0 = std::min(x0, x), x1 = std::max(x1, x + 1);
      y0 = std::min(y0, y), y1 = std::max(y1, y + 1);
    }
  }
  std::vector<std::uint8_t> cells;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      const std::uint8_t cell = now.at(x, y);
      cells.push_back(cell == last_.at(x, y) ? kUnchangedCell : cell);
    }
  }
  last_ = std::move(now);
  if (cells.empty()) return "";
  return fmt::format(R"({}"x":{},"y":{},"width":{},"height":{},"cells":{})", lattice, x0, y0,
                     x1 - x0, y1 - y0,
                     packed_json(std::span<const std::uint8_t>(cells), Packing::deflate));
}

}  // namespace cairn
