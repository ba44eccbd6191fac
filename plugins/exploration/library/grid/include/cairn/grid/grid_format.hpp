// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/grid/grid.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

class Registry;

/// A format of occupancy grids.
class CAIRN_API GridFormat : public Component {
 public:
  static constexpr std::string_view kKind = "grid_format";
  ~GridFormat() override;

  /// File name endings without the dot; first the one for new files.
  virtual std::vector<std::string> extensions() const = 0;
  /// All files that `read` reads for that file, itself first. Throws `Error` (input) as it does.
  virtual std::vector<std::filesystem::path> files_read(const std::filesystem::path& file) const {
    return {file};
  }
  /// All files that `write` writes for that file. Throws `Error` (usage) where it cannot write a
  /// map that has unknown cells.
  virtual std::vector<std::filesystem::path> files_written(
      const std::filesystem::path& file) const {
    return {file};
  }
  /// Throws `Error` (input) with the file, what was found and what was expected.
  virtual OccupancyGrid read(const std::filesystem::path& file) = 0;
  /// Each file that belongs to it is written beside its name and renamed. Throws `Error` (input).
  virtual void write(const OccupancyGrid& grid, const std::filesystem::path& file) = 0;
};

/// Whether some format of grids goes by the ending of `name`, a file or a file with options.
CAIRN_API bool names_grid(std::string_view name, Registry& registry);

/// All files of a grid, named as in `read_grid` and `write_grid`: "floor.yaml" and "floor.png" of
/// "floor.yaml:mode=raw". Throw `Error` (usage, input).
CAIRN_API std::vector<std::filesystem::path> grid_files_read(std::string_view name,
                                                             Registry& registry);
CAIRN_API std::vector<std::filesystem::path> grid_files_written(std::string_view name,
                                                                Registry& registry);

/// Reads a grid: `floor.yaml`, or with options of its format `picture.png:resolution=0.05`. The
/// format is that of the ending. Throws `Error` (usage, input).
CAIRN_API OccupancyGrid read_grid(std::string_view name, Registry& registry);
/// Writes a grid, named likewise.
CAIRN_API void write_grid(const OccupancyGrid& grid, std::string_view name, Registry& registry);

}  // namespace cairn
