// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/report/scene.hpp"
#include "canvas.hpp"
#include "plot_options.hpp"

namespace cairn::plot {

// Each draws one kind of plot, and throws `Error` (input) where `album` has no data for it.

/// Poses and edges of each graph, with marks and ellipses as `options` says.
void draw_trajectories(Canvas& canvas, const Theme& theme, const Album& album,
                       const PlotOptions& options);
/// Map, graph and newest scan of each recorded exploration at its end, or at a decision with what
/// was to choose from; `options` says which.
void draw_maps(Canvas& canvas, const Theme& theme, const Album& album, const PlotOptions& options);
/// chi2 of each run against iterations or time, logarithmic.
void draw_convergence(Canvas& canvas, const Theme& theme, const Album& album, bool against_time);
/// Seconds of each iteration of each run.
void draw_steps(Canvas& canvas, const Theme& theme, const Album& album);
/// Median times of a comparison, with their spread.
void draw_bars(Canvas& canvas, const Theme& theme, const Album& album);
/// Time and peak memory of each solver of a comparison against the size of its graphs, both axes
/// logarithmic, so that a power law is a straight line.
void draw_scaling(Canvas& canvas, const Theme& theme, const Album& album);
/// Columns of tables against one of them; `options` says which.
void draw_columns(Canvas& canvas, const Theme& theme, const Album& album,
                  const PlotOptions& options);
/// Where H has blocks, and where L has them in the order of a linear solver.
void draw_sparsity(Canvas& canvas, const Theme& theme, const Album& album, LinearSolver& solver);

}  // namespace cairn::plot
