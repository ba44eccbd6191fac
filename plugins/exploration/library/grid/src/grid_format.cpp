// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/grid_format.hpp"

#include "cairn/io/format_by_ending.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kWhat = "grids";

}  // namespace

GridFormat::~GridFormat() = default;

bool names_grid(std::string_view name, Registry& registry) {
  const std::string ending = file_ending(parse_named_file(name).file);
  return !format_of_ending<GridFormat>(ending, registry).name.empty();
}

std::vector<fs::path> grid_files_read(std::string_view name, Registry& registry) {
  return with_format<GridFormat>(
      name, kWhat, registry,
      [](const GridFormat& format, const fs::path& file) { return format.files_read(file); });
}

std::vector<fs::path> grid_files_written(std::string_view name, Registry& registry) {
  return with_format<GridFormat>(
      name, kWhat, registry,
      [](const GridFormat& format, const fs::path& file) { return format.files_written(file); });
}

OccupancyGrid read_grid(std::string_view name, Registry& registry) {
  return with_format<GridFormat>(
      name, kWhat, registry,
      [](GridFormat& format, const fs::path& file) { return format.read(file); });
}

void write_grid(const OccupancyGrid& grid, std::string_view name, Registry& registry) {
  with_format<GridFormat>(name, kWhat, registry, [&](GridFormat& format, const fs::path& file) {
    format.write(grid, file);
  });
}

}  // namespace cairn
