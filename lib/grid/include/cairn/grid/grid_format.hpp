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
  /// Throws `Error` (input) with the file, what was found and what was expected.
  virtual OccupancyGrid read(const std::filesystem::path& file) = 0;
  /// Each file that belongs to it is written beside its name and renamed. Throws `Error` (input).
  virtual void write(const OccupancyGrid& grid, const std::filesystem::path& file) = 0;
};

/// Whether some format of grids goes by the ending of `name`, a file or a file with options.
CAIRN_API bool names_grid(std::string_view name, Registry& registry);

/// The file of a name that may have options behind it: "floor.yaml" of "floor.yaml:mode=raw".
CAIRN_API std::filesystem::path grid_file(std::string_view name);

/// Reads a grid: `floor.yaml`, or with options of its format `picture.png:resolution=0.05`. The
/// format is that of the ending. Throws `Error` (usage, input).
CAIRN_API OccupancyGrid read_grid(std::string_view name, Registry& registry);
/// Writes a grid, named likewise.
CAIRN_API void write_grid(const OccupancyGrid& grid, std::string_view name, Registry& registry);

}  // namespace cairn
