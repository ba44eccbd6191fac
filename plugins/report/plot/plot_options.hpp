// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <string>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/option_fields.hpp"

namespace cairn::plot {

/// Options of the plots `svg`, `png` and `pdf`, and of their numbers, `json`.
struct PlotOptions {
  std::string what = "auto";
  int width = 900, height = 600;  ///< [px; in a PDF 1/96 inch]
  std::string theme = "light";
  std::string colour = "class";
  bool poses = false;     ///< of trajectories: a mark at each pose
  double ellipses = 0.0;  ///< of trajectories: covariances of positions [σ]; 0: none
  int decision = 0;       ///< of maps: at which decision of the robot, from 1; 0: at the end
  /// Of convergence: iterations (empty, too) or time; of columns: the name of one, or the first.
  std::string x;
  std::string y_columns;  ///< its panels, separated by line ends: each a pattern with * and ?
  double x_max = std::numeric_limits<double>::infinity();
  std::string logarithmic = "none";              ///< axes of a plot of columns
  std::string linear_solver = "block_cholesky";  ///< whose elimination order is drawn

  static auto fields() {
    using O = PlotOptions;
    return OptionFields<O>()
        .choice("what", &O::what,
                {"auto", "trajectory", "convergence", "bars", "scaling", "sparsity", "steps",
                 "columns", "map"},
                "what to draw; auto: columns of CSV, bars of a comparison, else the trajectory, "
                "else convergence")
        .integer("width", &O::width, 100, 20000, "width [px; in a PDF 1/96 inch]")
        .integer("height", &O::height, 100, 20000, "height [px; in a PDF 1/96 inch]")
        .choice("theme", &O::theme, {"light", "dark"}, "colours for light or dark paper")
        .choice("colour", &O::colour, {"class", "residual"}, "what colours edges")
        .boolean("poses", &O::poses, "marks each pose of a trajectory")
        .real("ellipses", &O::ellipses, 0.0, 1000.0,
              "standard deviations of the ellipses of a trajectory's covariances, 0: none; of a "
              "map the robot's, 0: 3")
        .integer("decision", &O::decision, 0, 2147483647,
                 "of a map: when this decision was made, counted from 1, with what was to choose "
                 "from; 0: at the end")
        .text("x", &O::x,
              "horizontal axis: of convergence iterations or time, of columns one of them; empty: "
              "iterations, or the first column")
        .text("y_columns", &O::y_columns,
              "columns to draw: a pattern with * and ? for each panel, separated by line ends; "
              "empty: one panel with all")
        .real("x_max", &O::x_max, std::numeric_limits<double>::lowest(),
              std::numeric_limits<double>::infinity(),
              "right end of columns: rows beyond it are not drawn")
        .choice("logarithmic", &O::logarithmic, {"none", "x", "y", "xy"},
                "logarithmic axes of columns")
        .component<LinearSolver>("linear_solver", &O::linear_solver,
                                 "whose elimination order the sparsity of L has");
  }
};

}  // namespace cairn::plot
