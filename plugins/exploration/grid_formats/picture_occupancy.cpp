// SPDX-License-Identifier: BSD-3-Clause
#include "picture_occupancy.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn::grids {
namespace {

/// Between the thresholds, whichever they are by default, and what ROS' map saver writes.
constexpr std::uint8_t kUnknownLevel = 205, kFreeLevel = 254;

std::int8_t occupancy_of(int level, bool opaque, const PictureMeaning& meaning) {
  if (meaning.negate) level = 255 - level;
  if (meaning.mode == PictureMode::raw)
    return level > 100 ? kUnknownCell : static_cast<std::int8_t>(level);
  if (!opaque) return kUnknownCell;
  const double p = (255 - level) / 255.0;
  if (p > meaning.occupied) return 100;
  if (p < meaning.free) return 0;
  if (meaning.mode == PictureMode::trinary) return kUnknownCell;
  const double ratio = (p - meaning.free) / (meaning.occupied - meaning.free);
  return static_cast<std::int8_t>(std::lround(1.0 + 98.0 * ratio));
}

int level_of(std::int8_t occupancy, const PictureMeaning& meaning) {
  switch (meaning.mode) {
    case PictureMode::raw:
      return occupancy < 0 ? 255 : occupancy;
    case PictureMode::trinary:
      switch (CellThresholds{}.state(occupancy)) {
        case CellState::free:
          return kFreeLevel;
        case CellState::occupied:
          return 0;
        case CellState::unknown:
          break;
      }
      return kUnknownLevel;
    case PictureMode::scale:
      break;
  }
  if (occupancy < 0) return kUnknownLevel;
  if (occupancy == 0 || occupancy == 100) return occupancy == 0 ? 255 : 0;
  const double p = meaning.free + (meaning.occupied - meaning.free) * (occupancy - 1) / 98.0;
  // Rounding must not lead past a threshold.
  const double least = std::ceil(255.0 * (1.0 - meaning.occupied)),
               largest = std::floor(255.0 * (1.0 - meaning.free));
  return static_cast<int>(std::clamp(std::round(255.0 * (1.0 - p)), least, largest));
}

}  // namespace

OccupancyGrid to_grid(const Picture& picture, const PictureMeaning& meaning, GridFrame frame,
                      const std::string& name) {
  frame.width = picture.width;
  frame.height = picture.height;
  check_frame(frame, name);
  if (!(meaning.free < meaning.occupied)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: cells are free below {} and occupied above {}: the first must be "
                            "the smaller one",
                            name, meaning.free, meaning.occupied));
  }
  OccupancyGrid grid{frame, std::vector<std::int8_t>(picture.grey.size())};
  for (int row = 0; row < picture.height; ++row) {
    for (int x = 0; x < picture.width; ++x) {
      const std::size_t pixel = frame.index(x, row);
      const bool opaque = picture.opacity.empty() || picture.opacity[pixel] == 255;
      grid.occupancy[frame.index(x, picture.height - 1 - row)] =
          occupancy_of(picture.grey[pixel], opaque, meaning);
    }
  }
  return grid;
}

Picture to_picture(const OccupancyGrid& grid, const PictureMeaning& meaning) {
  const GridFrame& frame = grid.frame;
  Picture picture{.width = frame.width,
                  .height = frame.height,
                  .grey = std::vector<std::uint8_t>(grid.occupancy.size())};
  if (meaning.mode == PictureMode::scale) picture.opacity.resize(grid.occupancy.size(), 255);
  bool opaque = true;
  for (int row = 0; row < frame.height; ++row) {
    for (int x = 0; x < frame.width; ++x) {
      const std::int8_t occupancy = grid.occupancy[frame.index(x, frame.height - 1 - row)];
      const int level = level_of(occupancy, meaning);
      const std::size_t pixel = frame.index(x, row);
      picture.grey[pixel] = static_cast<std::uint8_t>(meaning.negate ? 255 - level : level);
      if (meaning.mode != PictureMode::scale || occupancy >= 0) continue;
      picture.opacity[pixel] = 0;
      opaque = false;
    }
  }
  if (opaque) picture.opacity.clear();
  return picture;
}

}  // namespace cairn::grids
