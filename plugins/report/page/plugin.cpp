// SPDX-License-Identifier: BSD-3-Clause
// The picture `html`: one page that opens from disk, without a network.
#include <dlfcn.h>

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/report/album_json.hpp"
#include "cairn/runtime/error.hpp"

void cairn_register(cairn::Registrar& registrar);

namespace cairn {
namespace {

constexpr std::string_view kPlaceholder = "@CAIRN_DATA@";

/// Puts the data into the page. Throws `Error` (plugin) if `page` has not exactly one place for it.
std::string fill(std::string_view page, std::string_view data) {
  const std::size_t place = page.find(kPlaceholder);
  if (place == std::string_view::npos ||
      page.find(kPlaceholder, place + 1) != std::string_view::npos) {
    throw Error(ErrorCode::plugin,
                fmt::format("the page to fill in must hold {} exactly once", kPlaceholder));
  }
  std::string filled(page);
  return filled.replace(place, kPlaceholder.size(), data);
}

/// The page as it was built: in the folder `report` beside this plugin.
std::filesystem::path page_file() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&cairn_register), &info) == 0) {
    throw Error(ErrorCode::plugin, "html: the location of its plugin cannot be determined");
  }
  return std::filesystem::path(info.dli_fname).parent_path() / "report" / "report.html";
}

class Html final : public Picture {
 public:
  std::string draw(const Album& album) override {
    if (!album.tables.empty()) {
      throw Error(ErrorCode::input,
                  fmt::format("html: the page has no part for CSV; to draw {}: cairn plot",
                              album.tables.front().name));
    }
    const std::filesystem::path file = page_file();
    if (!std::filesystem::exists(file)) {
      throw Error(ErrorCode::plugin,
                  fmt::format("html: {} is missing; install cairn again", file.string()));
    }
    return fill(read_file(file), album_json(album, AlbumFrames::all));
  }
};

}  // namespace
}  // namespace cairn

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  registrar.add<Picture>("html", OptionTable{},
                         [](const Options&, Registry&) { return std::make_unique<Html>(); });
}
