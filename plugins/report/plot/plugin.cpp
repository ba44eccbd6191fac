// SPDX-License-Identifier: BSD-3-Clause
// The pictures `svg`, `png` and `pdf`.
#include <memory>
#include <string>

#include <fmt/core.h>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "plot_options.hpp"
#include "plots.hpp"

namespace cairn {
namespace {

using plot::PlotOptions;
using plot::Subject;

class Plot final : public Picture {
 public:
  Plot(std::string format, const PlotOptions& options, Registry& registry)
      : format_(std::move(format)), options_(options), theme_(plot::theme(options.theme)) {
    if (options.what == Subject::sparsity)
      solver_ = registry.make<LinearSolver>(options.linear_solver);
  }

  std::string draw(const Album& album) override {
    plot::Canvas canvas(format_, options_.width, options_.height, theme_.paper);
    const Subject what = options_.what == Subject::automatic ? choose(album) : options_.what;
    const bool time = what != Subject::columns && against_time();
    switch (what) {
      case Subject::automatic:
        break;  // has been chosen
      case Subject::trajectory:
        plot::draw_trajectories(canvas, theme_, album, options_);
        break;
      case Subject::convergence:
        plot::draw_convergence(canvas, theme_, album, time);
        break;
      case Subject::bars:
        plot::draw_bars(canvas, theme_, album);
        break;
      case Subject::scaling:
        plot::draw_scaling(canvas, theme_, album);
        break;
      case Subject::sparsity:
        plot::draw_sparsity(canvas, theme_, album, *solver_);
        break;
      case Subject::steps:
        plot::draw_steps(canvas, theme_, album);
        break;
      case Subject::columns:
        plot::draw_columns(canvas, theme_, album, options_);
        break;
      case Subject::map:
        plot::draw_maps(canvas, theme_, album, options_);
        break;
    }
    return canvas.finish();
  }

 private:
  bool against_time() const {
    if (options_.x.empty() || options_.x == "iterations") return false;
    if (options_.x == "time") return true;
    throw Error(
        ErrorCode::usage,
        fmt::format("x is '{}', expected iterations or time: only CSV has columns", options_.x));
  }

  static Subject choose(const Album& album) {
    if (!album.tables.empty()) return Subject::columns;
    if (!album.bench.empty()) return Subject::bars;
    for (const Scene& scene : album.scenes) {
      if (!scene.estimates.empty()) return Subject::trajectory;
    }
    return Subject::convergence;
  }

  std::string format_;
  PlotOptions options_;
  plot::Theme theme_;
  std::unique_ptr<LinearSolver> solver_;
};

}  // namespace
}  // namespace cairn

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  for (const std::string format : {"svg", "png", "pdf"}) {
    registrar.add<Picture, plot::PlotOptions>(
        format, [format](const plot::PlotOptions& options, Registry& registry) {
          return std::make_unique<Plot>(format, options, registry);
        });
  }
}
