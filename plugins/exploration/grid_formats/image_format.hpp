// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <numbers>

#include "cairn/grid/grid_format.hpp"
#include "picture_occupancy.hpp"

namespace cairn::grids {

struct ImageOptions {
  PictureMeaning meaning{};
  double resolution = 0.0;  ///< [m]; 0: not given
  double x = 0.0, y = 0.0, yaw = 0.0;

  static auto fields() {
    using O = ImageOptions;
    return OptionFields<O>()
        .real("resolution", &O::resolution, 0.0, 1e6, "metres per pixel, which an image lacks")
        .real("x", &O::x, -1e9, 1e9, "of the lower left corner [m]")
        .real("y", &O::y, -1e9, 1e9, "of the lower left corner [m]")
        .real("yaw", &O::yaw, -std::numbers::pi, std::numbers::pi,
              "by which the image is turned about that corner [rad]")
        .part(&O::meaning);
  }
};

/// An image alone. What it lacks are options.
class ImageFormat final : public GridFormat {
 public:
  explicit ImageFormat(const ImageOptions& options) : options_(options) {}
  std::vector<std::string> extensions() const override { return {"png", "pgm"}; }
  std::vector<std::filesystem::path> files_written(
      const std::filesystem::path& file) const override;
  OccupancyGrid read(const std::filesystem::path& file) override;
  void write(const OccupancyGrid& grid, const std::filesystem::path& file) override;

 private:
  ImageOptions options_;
};

}  // namespace cairn::grids
