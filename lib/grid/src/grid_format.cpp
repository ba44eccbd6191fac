// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/grid/grid_format.hpp"

#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "cairn/io/format.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"

namespace cairn {

GridFormat::~GridFormat() = default;

namespace {

namespace fs = std::filesystem;

/// A file and the options of its format.
struct NamedGrid {
  fs::path file;
  OptionValues options;
};

/// What stands behind the last ':' is options if it holds '=', unless there is a file of the whole
/// name.
NamedGrid parse(std::string_view name) {
  const std::size_t colon = name.rfind(':');
  std::error_code ignored;
  if (colon == std::string_view::npos || name.find('=', colon) == std::string_view::npos ||
      fs::exists(fs::path(name), ignored))
    return {fs::path(name), {}};
  const std::string options = "file" + std::string(name.substr(colon));
  return {fs::path(name.substr(0, colon)), parse_component(options).values};
}

struct Found {
  std::string name;  ///< of the format, empty: none
  std::vector<std::string> endings;
  std::optional<Error> broken;  ///< a plugin's, which is no reason not to use another
};

Found find_format(const std::string& wanted, Registry& registry) {
  Found found;
  for (const std::string& name : registry.names(GridFormat::kKind)) {
    try {
      for (const std::string& known : registry.make<GridFormat>(name)->extensions()) {
        if (known == wanted && found.name.empty()) found.name = name;
        found.endings.push_back(known);
      }
    } catch (const Error& error) {
      if (!found.broken) found.broken = error;
    }
  }
  return found;
}

/// Calls `use` with the format of a named grid and its file.
template <class Use>
auto with_format(std::string_view name, Registry& registry, const Use& use) {
  NamedGrid named = parse(name);
  const Found found = find_format(file_ending(named.file), registry);
  if (found.name.empty() && found.broken) throw Error(*found.broken);
  if (found.endings.empty())
    throw Error(ErrorCode::usage, fmt::format("{}: no plugin of grid formats is on offer", name));
  if (found.name.empty()) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: no format of grids goes by that ending; on offer: .{}",
                            named.file.string(), fmt::join(found.endings, ", .")));
  }
  const auto format =
      registry.make<GridFormat>(ComponentSpec{found.name, std::move(named.options)});
  return call_plugin([&] { return fmt::format("grid format '{}'", found.name); },
                     [&] { return use(*format, named.file); });
}

}  // namespace

fs::path grid_file(std::string_view name) { return parse(name).file; }

bool names_grid(std::string_view name, Registry& registry) {
  return !find_format(file_ending(parse(name).file), registry).name.empty();
}

OccupancyGrid read_grid(std::string_view name, Registry& registry) {
  return with_format(name, registry,
                     [](GridFormat& format, const fs::path& file) { return format.read(file); });
}

void write_grid(const OccupancyGrid& grid, std::string_view name, Registry& registry) {
  with_format(name, registry,
              [&](GridFormat& format, const fs::path& file) { format.write(grid, file); });
}

}  // namespace cairn
