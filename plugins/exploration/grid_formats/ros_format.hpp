// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/grid/grid_format.hpp"
#include "picture_occupancy.hpp"

namespace cairn::grids {

/// Of what is written; what is read says so itself.
struct RosOptions {
  PictureMode mode = PictureMode::trinary;
  std::string picture = "png";

  static auto fields() {
    using O = RosOptions;
    return OptionFields<O>()
        .choice("mode", &O::mode, "of what is written")
        .choice("image", &O::picture, {"png", "pgm"}, "of what is written");
  }
};

/// The maps of ROS' map server: a YAML with the keys image, resolution, origin and, if not the
/// defaults, negate, occupied_thresh, free_thresh and mode. In mode trinary transparent pixels are
/// unknown (the map server takes the mean of colours and opacity).
class RosFormat final : public GridFormat {
 public:
  explicit RosFormat(const RosOptions& options) : options_(options) {}
  std::vector<std::string> extensions() const override { return {"yaml", "yml"}; }
  std::vector<std::filesystem::path> files_read(const std::filesystem::path& file) const override;
  std::vector<std::filesystem::path> files_written(
      const std::filesystem::path& file) const override;
  OccupancyGrid read(const std::filesystem::path& file) override;
  void write(const OccupancyGrid& grid, const std::filesystem::path& file) override;

 private:
  std::filesystem::path written_picture(const std::filesystem::path& file) const;
  RosOptions options_;
};

}  // namespace cairn::grids
