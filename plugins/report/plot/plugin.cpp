// SPDX-License-Identifier: BSD-3-Clause
// The pictures `svg`, `png` and `pdf`, which Python draws, and `json`, which it draws them of.
#include <memory>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/io/packed_array.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/report/album_json.hpp"
#include "plot_options.hpp"
#include "python.hpp"
#include "sparsity.hpp"

namespace cairn {
namespace {

using plot::PlotOptions;

std::string options_json(const PlotOptions& options) {
  return fmt::format(
      R"({{"what":{},"width":{},"height":{},"theme":{},"colour":{},"poses":{},"ellipses":{},)"
      R"("decision":{},"x":{},"y_columns":{},"x_max":{},"logarithmic":{}}})",
      json_string(options.what), options.width, options.height, json_string(options.theme),
      json_string(options.colour), options.poses, json_number(options.ellipses), options.decision,
      json_string(options.x), json_string(options.y_columns), json_number(options.x_max),
      json_string(options.logarithmic));
}

class Plot final : public Picture {
 public:
  Plot(std::string format, PlotOptions options, Registry& registry)
      : format_(std::move(format)), options_(std::move(options)) {
    if (options_.what == "sparsity") solver_ = registry.make<LinearSolver>(options_.linear_solver);
    if (format_ != "json") plot::check_python();
  }

  std::string draw(const Album& album) override {
    std::string numbers = fmt::format(
        R"({{"format":"cairn-plot","version":1,"options":{},"sparsity":{},"album":{}}})",
        options_json(options_), solver_ ? plot::sparsity_json(album, *solver_) : "null",
        album_json(album, AlbumFrames::none));
    return format_ == "json" ? numbers : plot::draw_by_python(format_, numbers);
  }

 private:
  std::string format_;
  PlotOptions options_;
  std::unique_ptr<LinearSolver> solver_;
};

}  // namespace
}  // namespace cairn

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  for (const std::string format : {"svg", "png", "pdf", "json"}) {
    registrar.add<Picture, PlotOptions>(format,
                                        [format](const PlotOptions& options, Registry& registry) {
                                          return std::make_unique<Plot>(format, options, registry);
                                        });
  }
}
