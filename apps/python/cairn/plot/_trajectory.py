# SPDX-License-Identifier: BSD-3-Clause
"""Graphs: poses, edges, landmarks, covariances."""
from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from ._axes import Names, Plot, bounds_of, chain, draw_line, draw_marks, ellipse, equal_limits, locator, set_ticks, tick_text
from ._numbers import LANDMARK, LOOP, ODOMETRY, OTHER, PATH, Estimate, PlotError, Scene
from ._theme import PIXEL, TEXT, Stroke, Theme

AZIMUTH, ELEVATION = math.radians(35), math.radians(28)  # how a graph in space is looked at
PROJECTION = np.array([
    [math.cos(AZIMUTH), math.sin(AZIMUTH), 0.0],
    [-math.sin(ELEVATION) * math.sin(AZIMUTH), math.sin(ELEVATION) * math.cos(AZIMUTH), math.cos(ELEVATION)],
])
GUESS_MAY_EXCEED = 2.5  # an initial guess further out than this many times the rest is cut off, not shrunk to
SHADES = 48
MARK, LEAST_MARK, LARGE_MARKS = 3.4, 1.2, 400  # side of the mark of a pose [px]; smaller where there are more poses than this
HEIGHTS = {"initial": 0, "peer": 1, "estimate": 2, "truth": 3}  # the truth is thin and dashed, and a good estimate would hide it


@dataclass
class Options:
    """`by_residual`: edges are coloured by their chi2, not by their class; `ellipses` [σ], 0: none."""

    by_residual: bool = False
    poses: bool = False
    ellipses: float = 0.0


@dataclass
class Layer:
    """An estimate as it is drawn."""

    estimate: Estimate
    points: np.ndarray
    stroke: Stroke

    @property
    def role(self) -> str:
        return self.estimate.role


def layers_of(scene: Scene, theme: Theme) -> list[Layer]:
    """What lies below first."""
    peers, layers = 0, []
    width = min(max(math.sqrt(1000 / max(len(scene.a), 1)), 0.35), 1.0)  # thinner where many lines would run into one
    for estimate in scene.estimates:
        stroke = theme.roles.get(estimate.role) or theme.peer(peers)
        peers += estimate.role == "peer"
        points = estimate.positions if scene.dimension == 2 else estimate.positions @ PROJECTION.T
        layers.append(Layer(estimate, points, stroke.thinner(width)))
    return sorted(layers, key=lambda layer: HEIGHTS[layer.role])


def main_layer(layers: list[Layer]) -> Layer:
    """The one that has loop closures, landmarks and poses: the uppermost but the truth, which has them where there is nothing else."""
    return next((layer for layer in reversed(layers) if layer.role != "truth"), layers[-1])


def visible_bounds(scene: Scene, layers: list[Layer]) -> np.ndarray:
    everything = bounds_of(layer.points for layer in layers)
    most = bounds_of(layer.points for layer in layers if layer.role != "initial")
    if everything is None:
        raise PlotError(f"{scene.name}: none of its variables has a position")
    if most is None or np.ptp(everything, axis=0).max() <= GUESS_MAY_EXCEED * np.ptp(most, axis=0).max():
        return everything
    return most


def mark_stroke(theme: Theme) -> Stroke:
    return Stroke(theme.residual(0.8), MARK)


def outline(theme: Theme) -> Stroke:
    return Stroke(theme.muted, 0.7)


class Drawing:
    """Puts the layers of a scene onto axes."""

    def __init__(self, ax: Axes, names: Names, theme: Theme, scene: Scene):
        self.ax, self.names, self.theme, self.scene = ax, names, theme, scene

    def draw(self, layers: list[Layer], options: Options) -> None:
        uppermost = main_layer(layers)
        for height, layer in enumerate(layers, 2):
            main = layer is uppermost
            if main and options.by_residual:
                self.draw_residuals(layer, height)
            else:
                if main:
                    self.draw_classes(layer, height)
                self.draw_path(layer, height)
            if main:
                self.draw_landmarks(layer, height)
            if options.ellipses > 0:
                self.draw_ellipses(layer, options.ellipses, height)
            if main and options.poses:
                self.draw_poses(layer, height)

    def draw_edges(self, name: str, layer: Layer, which: np.ndarray, stroke: Stroke, height: float) -> None:
        line = chain(self.scene.a[which], self.scene.b[which], layer.points)
        if len(line):
            draw_line(self.ax, self.names, name, line[:, 0], line[:, 1], stroke, height)

    def draw_path(self, layer: Layer, height: float) -> None:
        self.draw_edges(layer.role, layer, np.isin(self.scene.edge_class, (ODOMETRY, PATH)), layer.stroke, height)

    def draw_classes(self, layer: Layer, height: float) -> None:
        for name, edge_class, stroke in [("landmark-edges", LANDMARK, self.theme.landmark), ("other-edges", OTHER, self.theme.landmark),
                                         ("loop-closures", LOOP, self.theme.loop)]:
            self.draw_edges(name, layer, self.scene.edge_class == edge_class, stroke, height)

    def draw_landmarks(self, layer: Layer, height: float) -> None:
        points = layer.points[~self.scene.is_pose]
        if len(points):
            draw_marks(self.ax, self.names, "landmarks", points, self.theme.landmark.colour, "o", 3, height)

    def draw_poses(self, layer: Layer, height: float) -> None:
        side = max(LEAST_MARK, MARK * math.sqrt(LARGE_MARKS / max(LARGE_MARKS, len(layer.points))))
        draw_marks(self.ax, self.names, "poses", layer.points[self.scene.is_pose], mark_stroke(self.theme).colour, "s", side, height)

    def draw_ellipses(self, layer: Layer, sigmas: float, height: float) -> None:
        pieces = []
        for variable, covariance in zip(layer.estimate.covariance_variables, layer.estimate.covariances):
            planar = covariance if self.scene.dimension == 2 else PROJECTION @ covariance @ PROJECTION.T
            corners = ellipse(planar, sigmas)
            if len(corners) and np.isfinite(layer.points[variable]).all():
                pieces += [layer.points[variable] + corners, np.full((1, 2), np.nan)]
        if pieces:
            line = np.concatenate(pieces)
            draw_line(self.ax, self.names, "covariances", line[:, 0], line[:, 1], outline(self.theme), height)

    def draw_residuals(self, layer: Layer, height: float) -> None:
        """From the least to the worst, which lies on top and is wider."""
        chi2 = layer.estimate.edge_chi2
        if chi2 is None or not (chi2 > 0).any():
            self.draw_path(layer, height)
            return
        logarithms = np.log(chi2, out=np.full(len(chi2), -np.inf), where=chi2 > 0)
        known = np.sort(logarithms[np.isfinite(logarithms)])
        low = known[len(known) // 20]
        part = np.clip((logarithms - low) / max(known[-1] - low, 1e-9), 0, 1)
        shades = np.rint(part * (SHADES - 1)).astype(int)
        for shade in range(SHADES):
            worse = shade / (SHADES - 1)
            name = "largest-residual" if shade == SHADES - 1 else "residuals"
            self.draw_edges(name, layer, shades == shade, Stroke(self.theme.residual(worse), 0.75 + 2.25 * worse**3),
                            height + 0.5 * worse)


def draw_scale(ax: Axes, theme: Theme, width: float, height: float) -> None:
    """What stands for the length of a graph in space, which has no axes to read it from."""
    low, high = ax.get_xlim()
    longest = (high - low) / 4
    length = max(tick for tick in locator(0, longest, False, 3).tick_values(0, longest) if tick <= longest)
    part = length / (high - low)
    x, y = 8 / width, 8 / height
    bar = ax.plot([x, x + part], [y, y], color=theme.ink, linewidth=2 * PIXEL, transform=ax.transAxes, solid_capstyle="butt",
                  scalex=False, scaley=False)
    bar[0].set_gid("scale")
    ax.annotate(f"{tick_text(length)} m", (x, y), xycoords="axes fraction", xytext=(0, 4 * PIXEL), textcoords="offset points",
                fontsize=TEXT, color=theme.ink)


def legend_of(scene: Scene, theme: Theme, layers: list[Layer], options: Options) -> list[tuple[str, Stroke]]:
    legend = []
    for layer in reversed(layers):
        if options.by_residual and layer is main_layer(layers):
            legend += [("small residual", Stroke(theme.residual(0.1))), ("largest residual", Stroke(theme.residual(1), 3))]
        else:
            legend.append((layer.estimate.name, layer.stroke))
    if not options.by_residual and scene.has(LOOP):
        legend.append(("loop closure", theme.loop))
    if not options.by_residual and scene.has(LANDMARK):
        legend.append(("landmark", theme.landmark))
    if options.poses:
        legend.append(("pose", mark_stroke(theme)))
    if options.ellipses > 0:
        legend.append((f"covariance, {options.ellipses:.3g} σ", outline(theme)))
    return legend


def plot_of(scene: Scene, theme: Theme, options: Options) -> Plot:
    """A graph as it is drawn. Raises PlotError where it has nothing that can be."""
    layers = layers_of(scene, theme)
    if options.ellipses > 0 and not any(len(layer.estimate.covariances) for layer in layers):
        raise PlotError(
            f"{scene.name}: there are no covariances to draw: give the report of cairn optimize GRAPH --covariance blocks "
            "--json RUN.json -o OUT too, beside the GRAPH that it is of: cairn plot GRAPH RUN.json --ellipses 3")
    bounds = visible_bounds(scene, layers)
    in_space = scene.dimension == 3

    def paint(ax: Axes, names: Names) -> None:
        Drawing(ax, names, theme, scene).draw(layers, options)
        if not in_space:
            ax.set_xlabel("x [m]")
            ax.set_ylabel("y [m]")

    def fit(ax: Axes, width: float, height: float) -> None:
        equal_limits(ax, bounds, width, height)
        if in_space:
            draw_scale(ax, theme, width, height)
        else:
            set_ticks(ax, width, height)

    return Plot(scene.name, paint, fit, legend_of(scene, theme, layers, options), bare=in_space)


def plots_of(scenes: list[Scene], theme: Theme, options: Options) -> list[Plot]:
    shown = [scene for scene in scenes if scene.estimates]
    if not shown:
        raise PlotError("no graph to draw: give one, or a recording of a run")
    return [plot_of(scene, theme, options) for scene in shown]
