// SPDX-License-Identifier: BSD-3-Clause
// The pictures `svg`, `png` and `pdf`.
#include <memory>
#include <string>

#include "cairn/plugin/registry.hpp"
#include "plots.hpp"

namespace cairn {
namespace {

class Plot final : public Picture {
 public:
  Plot(std::string format, const Options& options, Registry& registry)
      : format_(std::move(format)),
        what_(options.text("what")),
        theme_(plot::theme(options.text("theme"))),
        width_(static_cast<int>(options.integer("width"))),
        height_(static_cast<int>(options.integer("height"))),
        by_residual_(options.text("colour") == "residual"),
        against_time_(options.text("x") == "time") {
    if (what_ == "sparsity") solver_ = registry.make<LinearSolver>(options.text("linear_solver"));
  }

  std::string draw(const Album& album) override {
    plot::Canvas canvas(format_, width_, height_, theme_.paper);
    const std::string what = what_ == "auto" ? choose(album) : what_;
    if (what == "trajectory") plot::draw_trajectories(canvas, theme_, album, by_residual_);
    if (what == "convergence") plot::draw_convergence(canvas, theme_, album, against_time_);
    if (what == "steps") plot::draw_steps(canvas, theme_, album);
    if (what == "bars") plot::draw_bars(canvas, theme_, album);
    if (what == "scaling") plot::draw_scaling(canvas, theme_, album);
    if (what == "sparsity") plot::draw_sparsity(canvas, theme_, album, *solver_);
    return canvas.finish();
  }

 private:
  static std::string choose(const Album& album) {
    if (!album.bench.empty()) return "bars";
    for (const Scene& scene : album.scenes) {
      if (!scene.estimates.empty()) return "trajectory";
    }
    return "convergence";
  }

  std::string format_, what_;
  plot::Theme theme_;
  int width_, height_;
  bool by_residual_, against_time_;
  std::unique_ptr<LinearSolver> solver_;
};

}  // namespace
}  // namespace cairn

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  for (const std::string format : {"svg", "png", "pdf"}) {
    registrar.add<Picture>(
        format,
        OptionTable{}
            .choice("what", "auto",
                    {"auto", "trajectory", "convergence", "bars", "scaling", "sparsity", "steps"},
                    "what to draw; auto: bars of a comparison, else the trajectory, else curves")
            .integer("width", 900, 100, 20000, "width [px; in a PDF 1/96 inch]")
            .integer("height", 600, 100, 20000, "height [px; in a PDF 1/96 inch]")
            .choice("theme", "light", {"light", "dark"}, "colours for light or dark paper")
            .choice("colour", "class", {"class", "residual"}, "what colours edges")
            .choice("x", "iterations", {"iterations", "time"}, "axis of convergence")
            .component("linear_solver", std::string(LinearSolver::kKind), "block_cholesky",
                       "whose elimination order the sparsity of L has"),
        [format](const Options& options, Registry& registry) {
          return std::make_unique<Plot>(format, options, registry);
        });
  }
}
