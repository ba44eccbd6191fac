# SPDX-License-Identifier: BSD-3-Clause
"""Maps of robots: what a recorded exploration knew at its end, or at a decision."""
from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.transforms import Affine2D

from ._axes import Names, Plot, chain, draw_line, draw_marks, ellipse, equal_limits, set_ticks
from ._numbers import LOOP, MOST, ODOMETRY, PlotError, array
from ._theme import Stroke, Theme

SIGMAS = 3.0  # of the ellipse, if nothing else is said
SHADES = 24
SCAN_DOT = 2.0  # [px]
FARTHEST = 1e9  # [m]
UNKNOWN, UNCHANGED = 255, 254
NOWHERE = (math.nan, math.nan)


@dataclass
class Map:
    """Cells from (x, y) on, counted from an origin: per cent occupied, or UNKNOWN."""

    resolution: float
    origin: tuple[float, float]
    yaw: float
    x: int = 0
    y: int = 0
    cells: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), np.uint8))

    def to_world(self) -> Affine2D:
        """From cells of `cells` to metres."""
        return Affine2D().translate(self.x, self.y).scale(self.resolution).rotate(self.yaw).translate(*self.origin)

    def take(self, x: int, y: int, part: np.ndarray) -> None:
        """Puts in the cells that have changed; the box grows with them."""
        if not self.cells.size:
            self.x, self.y = x, y
        left, bottom = min(x, self.x), min(y, self.y)
        right = max(x + part.shape[1], self.x + self.cells.shape[1])
        top = max(y + part.shape[0], self.y + self.cells.shape[0])
        if (right - left) * (top - bottom) > MOST:
            raise ValueError("a map that large cannot be")
        if (top - bottom, right - left) != self.cells.shape:
            old = self.cells
            self.cells = np.full((top - bottom, right - left), UNKNOWN, np.uint8)
            self.cells[self.y - bottom:self.y - bottom + old.shape[0], self.x - left:self.x - left + old.shape[1]] = old
            self.x, self.y = left, bottom
        view = self.cells[y - bottom:y - bottom + part.shape[0], x - left:x - left + part.shape[1]]
        changed = part != UNCHANGED
        view[changed] = np.where(part <= 100, part, UNKNOWN)[changed]


@dataclass
class Decision:
    """What was chosen from: paths (value, points), or a tree of them. Of values the least is the best."""

    paths: list[tuple[float, np.ndarray]] = field(default_factory=list)
    chosen: Optional[int] = None
    nodes: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    parents: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    values: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def all_values(self) -> np.ndarray:
        return self.values if len(self.nodes) else np.array([value for value, _ in self.paths])


@dataclass
class State:
    """What a recorded robot knew at some time."""

    name: str
    radius: float = 0.0  # of its body [m]
    map: Optional[Map] = None
    poses: dict[int, tuple[float, float]] = field(default_factory=dict)
    edges: dict[int, tuple[int, int, int]] = field(default_factory=dict)  # two poses and a class
    robot: tuple[float, float] = NOWHERE
    heading: float = 0.0
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((2, 2)))  # of the newest pose [m²]
    scan: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))  # where the beams of its newest scan ended [m]
    decision: Optional[Decision] = None


def _take_map(state: State, value: dict[str, Any]) -> None:
    if "resolution" in value:
        resolution, origin = float(value["resolution"]), [float(each) for each in value["origin"][:2]]
        yaw = float(value.get("yaw", 0.0))
        if not (1e-6 <= resolution <= 1e6 and len(origin) == 2 and max(abs(each) for each in origin) <= FARTHEST and abs(yaw) < 100):
            raise ValueError("a map that cannot be")
        state.map = Map(resolution, (origin[0], origin[1]), yaw)
    box: list[Any] = [value.get(name) for name in ("x", "y", "width", "height")]
    if state.map is None or not all(isinstance(each, int) and abs(each) <= MOST for each in box) or "cells" not in value:
        return
    x, y, width, height = box
    cells = array(value["cells"])
    if width > 0 and height > 0 and len(cells) == width * height:
        state.map.take(x, y, cells.reshape(height, width).astype(np.uint8))


def _take_motion(state: State, line: dict[str, Any]) -> None:
    if "map" in line:
        _take_map(state, line["map"])
    for number, x, y, *_ in line.get("poses") or []:
        state.poses[number] = (x, y)
    for number in line.get("removed_poses") or []:
        state.poses.pop(number, None)
    for number, a, b, edge_class, *_ in line.get("edges") or []:
        state.edges[number] = (a, b, edge_class)
    for number in line.get("removed_edges") or []:
        state.edges.pop(number, None)
    if line.get("estimate"):
        x, y, heading = line["estimate"][:3]
        if max(abs(x), abs(y)) <= FARTHEST:
            state.robot = (float(x), float(y))
        state.heading = float(heading)
    if "covariance" in line:
        xx, xy, yy = (line["covariance"] or (0.0, 0.0, 0.0))[:3]
        state.covariance = np.array([[xx, xy], [xy, yy]], dtype=float)


def _decision(line: dict[str, Any]) -> Decision:
    decision = Decision()
    for each in line.get("candidates") or []:
        points = np.array([point[:2] for point in each.get("points") or []], dtype=float).reshape(-1, 2)
        value = each.get("value")
        decision.paths.append((math.nan if value is None else float(value), points))
    chosen = line.get("chosen")
    if isinstance(chosen, int) and 0 <= chosen < len(decision.paths):
        decision.chosen = chosen
    tree = line.get("tree")
    if tree:
        nodes, parents, values = array(tree["positions"]).reshape(-1, 2), array(tree["parents"]).astype(int), array(tree["values"])
        if len(nodes) == len(parents) == len(values):
            decision.nodes, decision.values = nodes.astype(float), values.astype(float)
            decision.parents = np.where((parents >= 0) & (parents < len(parents)), parents, -1)
    return decision


def _scan_ends(state: State, scan: dict[str, Any]) -> np.ndarray:
    ranges = array(scan["ranges"]).astype(float)
    angles = state.heading + float(scan["first_angle"]) + float(scan["angle_step"]) * np.arange(len(ranges))
    seen = (ranges > 0) & (ranges < float(scan["max_range"]))
    return np.array(state.robot) + (ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1))[seen]


def _replayed(recording: dict[str, Any], name: str, wanted: Optional[int]) -> State:
    state, scan, last = State(name), None, None
    radius = ((recording.get("header") or {}).get("robot") or {}).get("radius")
    state.radius = float(radius) if isinstance(radius, (int, float)) else 0.0
    for line in recording.get("lines") or []:
        if "kind" not in line:
            _take_motion(state, line)
            scan = line.get("scan") or scan
        elif wanted is not None:
            if line.get("decision") == wanted:
                state.decision = _decision(line)
                break
            last = max(last or 0, line.get("decision") or 0)
    if wanted is not None and state.decision is None:
        raise PlotError(f"{name}: the recording has no decisions" if last is None
                        else f"{name}: there is no decision {wanted}; the last one is {last}")
    if state.map is None or not state.map.cells.size:
        raise PlotError(f"{name}: the recording has no map to draw")
    if scan:
        state.scan = _scan_ends(state, scan)
    return state


def state_of(recording: dict[str, Any], decision: Optional[int] = None) -> State:
    """What an EXPLORATION of docs/report.md knew at that decision, or at its end. Raises PlotError where it has no such decision, no
    map, or is damaged."""
    name = str(recording.get("name", "")) if isinstance(recording, dict) else ""
    try:
        with np.errstate(all="ignore"):
            return _replayed(recording, name, decision)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise PlotError(f"{name}: the recording is damaged ({error})") from error


def known_bounds(state: State) -> np.ndarray:
    """Where the known cells are, and the robot."""
    assert state.map is not None
    known = state.map.cells != UNKNOWN
    rows, columns = np.flatnonzero(known.any(1)), np.flatnonzero(known.any(0))
    corners = np.zeros((0, 2))
    if rows.size:
        x, y = (columns[0], columns[-1] + 1), (rows[0], rows[-1] + 1)
        corners = state.map.to_world().transform([(x[i], y[j]) for i in (0, 1) for j in (0, 1)])
    if not math.isnan(state.robot[0]):
        corners = np.concatenate([corners, [state.robot]])
    if not len(corners):
        raise PlotError(f"{state.name}: nothing on its map is known")
    return np.array([corners.min(0), corners.max(0)])


class Goodness:
    """How good a value is, from 0 (the worst) to 1 (the least, which is best). Where there are values below zero, which are gains,
    zero and more is worst."""

    def __init__(self, values: np.ndarray):
        values = values[np.isfinite(values)]
        self.empty = not values.size
        self.best, self.worst = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
        if self.best < 0:
            self.worst = min(self.worst, 0.0)
        self.differs = self.worst > self.best

    def of(self, values: np.ndarray) -> np.ndarray:
        part = (self.worst - values) / (self.worst - self.best) if self.differs else np.ones(len(values))
        return np.where(np.isfinite(values), np.clip(part, 0, 1), 0.0)


def _strokes(theme: Theme) -> dict[str, Stroke]:
    estimate = theme.roles["estimate"].colour
    return {"trajectory": Stroke(estimate, 1.2), "chosen": Stroke(theme.peer(2).colour, 3), "scan": Stroke(theme.peer(1).colour, 2),
            "robot": Stroke(estimate, 1.5)}


def _cell_colours(theme: Theme) -> np.ndarray:
    paper, ink = np.array(to_rgb(theme.paper)), np.array(to_rgb(theme.ink))
    part = np.minimum(np.arange(256) / 100, 1)[:, None]
    colours = paper + part * (ink - paper)
    colours[UNKNOWN] = to_rgb(theme.grid)
    return np.rint(255 * colours).astype(np.uint8)


def _joined(pieces: list[np.ndarray]) -> np.ndarray:
    """Lines (n, 2) as one with gaps."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([part for piece in pieces for part in (piece, gap)] or [gap])


def _draw_cells(ax: Axes, names: Names, theme: Theme, grid: Map) -> None:
    height, width = grid.cells.shape
    image = ax.imshow(_cell_colours(theme)[grid.cells], origin="lower", extent=(0, width, 0, height), interpolation="nearest",
                      aspect="auto", zorder=1, transform=grid.to_world() + ax.transData)
    names.give(image, "map")


def _draw_edges(ax: Axes, names: Names, state: State, name: str, kind: int, stroke: Stroke) -> None:
    edges = [(a, b) for a, b, edge_class in state.edges.values() if edge_class == kind and a in state.poses and b in state.poses]
    if edges:
        points = np.array([state.poses[pose] for edge in edges for pose in edge], dtype=float)
        first = np.arange(0, len(points), 2)
        line = chain(first, first + 1, points)
        draw_line(ax, names, name, line[:, 0], line[:, 1], stroke, 4)


def _draw_choices(ax: Axes, names: Names, theme: Theme, decision: Decision) -> None:
    """A tree, or the candidates, coloured by their values: the best lie on top."""
    values = decision.all_values()
    shades = np.rint(Goodness(values).of(values) * (SHADES - 1)).astype(int)
    for shade in np.unique(shades):
        if len(decision.nodes):
            chosen = (shades == shade) & (decision.parents >= 0)
            line = chain(decision.parents[chosen], np.flatnonzero(chosen), decision.nodes)
        else:
            line = _joined([points for (_, points), of in zip(decision.paths, shades) if of == shade])
        part = shade / (SHADES - 1)
        draw_line(ax, names, "choices", line[:, 0], line[:, 1], Stroke(theme.residual(part), 0.75 + part), 3 + 0.5 * part)


def _draw_robot(ax: Axes, names: Names, state: State, sigmas: float, stroke: Stroke) -> None:
    if math.isnan(state.robot[0]):
        return
    at = np.array(state.robot)
    body = ellipse(np.eye(2) * state.radius**2, 1.0) if state.radius > 0 else np.zeros((1, 2))
    draw_line(ax, names, "robot", at[0] + body[:, 0], at[1] + body[:, 1], stroke, 6, marker="" if state.radius > 0 else "o", markersize=3)
    if state.covariance.any():
        outline = at + ellipse(state.covariance, sigmas)
        draw_line(ax, names, "covariance", outline[:, 0], outline[:, 1], stroke, 6)


def _legend(state: State, theme: Theme, sigmas: float) -> list[tuple[str, Stroke]]:
    strokes = _strokes(theme)
    legend = [("trajectory", strokes["trajectory"])]
    if any(edge_class == LOOP for _, _, edge_class in state.edges.values()):
        legend.append(("loop closure", theme.loop))
    if len(state.scan):
        legend.append(("scan", strokes["scan"]))
    legend.append((f"robot, {sigmas:.3g} σ", strokes["robot"]))
    if state.decision is None:
        return legend
    goodness = Goodness(state.decision.all_values())
    if not goodness.empty:
        what = "path" if len(state.decision.nodes) else "candidate"
        legend.append((f"{what} of {goodness.best:.3g}", Stroke(theme.residual(1), 2)))
        if goodness.differs:
            legend.append((f"of {goodness.worst:.3g}", Stroke(theme.residual(0), 1)))
    if state.decision.chosen is not None:
        legend.append(("chosen", strokes["chosen"]))
    return legend


def plot_of(state: State, theme: Theme, sigmas: float = SIGMAS) -> Plot:
    """Map, graph and newest scan, and at a decision what was to choose from."""
    bounds = known_bounds(state)
    strokes = _strokes(theme)

    def paint(ax: Axes, names: Names) -> None:
        assert state.map is not None
        ax.set_facecolor(theme.grid)
        _draw_cells(ax, names, theme, state.map)
        if len(state.scan):
            draw_marks(ax, names, "scan", state.scan, strokes["scan"].colour, "o", SCAN_DOT, 2)
        if state.decision:
            _draw_choices(ax, names, theme, state.decision)
        _draw_edges(ax, names, state, "loop-closures", LOOP, theme.loop)
        _draw_edges(ax, names, state, "trajectory", ODOMETRY, strokes["trajectory"])
        if state.decision and state.decision.chosen is not None:
            points = state.decision.paths[state.decision.chosen][1]
            draw_line(ax, names, "chosen", points[:, 0], points[:, 1], strokes["chosen"], 5)
        _draw_robot(ax, names, state, sigmas, strokes["robot"])
        ax.set_xlabel("x [m]")
        ax.set_ylabel("y [m]")

    def fit(ax: Axes, width: float, height: float) -> None:
        equal_limits(ax, bounds, width, height)
        set_ticks(ax, width, height)

    return Plot(state.name, paint, fit, _legend(state, theme, sigmas))
