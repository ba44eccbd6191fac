// SPDX-License-Identifier: BSD-3-Clause
#include "image_format.hpp"

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::grids {

OccupancyGrid ImageFormat::read(const std::filesystem::path& file) {
  if (options_.resolution == 0.0) {
    throw Error(ErrorCode::usage, fmt::format("{0}: an image does not say how large its pixels "
                                              "are: {0}:resolution=0.05 for 5 cm",
                                              file.string()));
  }
  const GridFrame frame{
      .resolution = options_.resolution, .origin = {options_.x, options_.y}, .yaw = options_.yaw};
  return to_grid(read_picture(file), options_.meaning, frame, file.string());
}

std::vector<std::filesystem::path> ImageFormat::files_written(
    const std::filesystem::path& file) const {
  if (options_.meaning.mode == PictureMode::scale && file_ending(file) == "pgm")
    refuse_opacity(file);
  return {file};
}

void ImageFormat::write(const OccupancyGrid& grid, const std::filesystem::path& file) {
  write_picture(to_picture(grid, options_.meaning), file);
}

}  // namespace cairn::grids
