# SPDX-License-Identifier: BSD-3-Clause
"""A picture of one or several plots: panels with a title, a legend and axes, as files."""
from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D

from . import _bench, _curves, _exploration, _sparsity, _trajectory
from ._axes import RC, Names, Plot, printable, style_axes
from ._numbers import PlotError, array, scene
from ._theme import PIXEL, TEXT, THEMES, TITLE, Stroke, Theme

MARGIN, ROW, SAMPLE, GAP = 16, 17, 26, 18  # [px]
MOST_LABEL = 420  # [px]


@dataclass
class Box:
    """Of a page, in pixels from its left upper corner."""

    x: float
    y: float
    width: float
    height: float

    def below(self, used: float) -> Box:
        return Box(self.x, self.y + used, self.width, self.height - used)


class Page:
    """A figure whose parts are placed by pixels (in a PDF, 1/96 inch)."""

    def __init__(self, width: int, height: int, theme: Theme):
        def inches(pixels: int) -> float:
            return pixels / 96 if int(pixels / 96 * 96) == pixels else (pixels + 1e-6) / 96

        self.width, self.height, self.theme = width, height, theme
        self.figure = Figure(figsize=(inches(width), inches(height)), dpi=96, facecolor=theme.paper)
        self.canvas = FigureCanvasAgg(self.figure)
        self.names = Names()

    def text_width(self, text: str, size: float = TEXT, bold: bool = False) -> float:
        font = FontProperties(family="DejaVu Sans", size=size, weight="bold" if bold else "normal")
        return float(self.canvas.get_renderer().get_text_width_height_descent(text.replace(r"\$", "$"), font, False)[0])

    def text(self, x: float, y: float, text: str, colour: str, most: float, size: float = TEXT, bold: bool = False) -> float:
        """At a base line; what is wider than `most` ends in an ellipsis. Returns the width."""
        text = printable(text)
        width = self.text_width(text, size, bold)
        while width > most and len(text) > 3:
            keep = min(int(len(text) * most / width), len(text) - 1)
            text = text.rstrip("…")[:max(keep, 2) - 1] + "…"
            width = self.text_width(text, size, bold)
        self.figure.text(x / self.width, 1 - y / self.height, text, color=colour, fontsize=size, fontweight="bold" if bold else "normal",
                         va="baseline", ha="left")
        return width

    def sample(self, x: float, y: float, stroke: Stroke) -> None:
        line = Line2D([x / self.width, (x + SAMPLE) / self.width], [1 - y / self.height] * 2, transform=self.figure.transFigure,
                      **stroke.line())
        self.figure.add_artist(line)

    def heading(self, box: Box, plot: Plot) -> Box:
        """A title and below it a legend, in as many rows as it takes. Returns what is left of the box."""
        y = box.y + TITLE / PIXEL
        self.text(box.x, y, plot.title, self.theme.ink, box.width, TITLE, True)
        if plot.subtitle:
            y += ROW
            self.text(box.x, y, plot.subtitle, self.theme.muted, box.width)
        x, y = box.x, y + (ROW + 2 if plot.legend else 0)
        most = min(box.width - SAMPLE - 8, MOST_LABEL)
        for name, stroke in plot.legend:
            width = SAMPLE + 6 + min(self.text_width(printable(name)), most)
            if x > box.x and x + width > box.x + box.width:
                x, y = box.x, y + ROW
            self.sample(x, y - 4, stroke)
            self.text(x + SAMPLE + 6, y, name, self.theme.ink, most)
            x += width + GAP
        return box.below(y + 12 - box.y)

    def place(self, ax: Axes, box: Box) -> None:
        ax.set_position((box.x / self.width, 1 - (box.y + box.height) / self.height, box.width / self.width, box.height / self.height))

    def add(self, box: Box, plot: Plot) -> Axes:
        """The plot with its heading in a box."""
        rest = self.heading(box, plot)
        ax = self.figure.add_axes((0, 0, 1, 1))
        style_axes(ax, self.theme)
        plot.paint(ax, self.names)
        if plot.bare:
            ax.axis("off")
            self.place(ax, rest)
            plot.fit(ax, rest.width, rest.height)
            return ax
        below = 2 * TEXT / PIXEL + (18 if plot.most_height == math.inf else 4)
        area = Box(rest.x, rest.y, rest.width, max(min(rest.height - below, plot.most_height), 10))
        plot.fit(ax, area.width - 70, area.height)  # the texts beside the axes depend little on the numbers
        self.place(ax, area)
        left = self.left_of(ax)
        area = Box(rest.x + left, rest.y, max(rest.width - left - 8, 10), area.height)
        self.place(ax, area)
        plot.fit(ax, area.width, area.height)
        if plot.most_height == math.inf:
            ax.xaxis.set_label_coords(0.5, -(TEXT / PIXEL + 11) / area.height)
        else:
            ax.xaxis.set_label_coords(0, -6 / area.height)
        if ax.get_ylabel():
            ax.yaxis.set_label_coords((11 - left) / area.width, 0.5)
        return ax

    def left_of(self, ax: Axes) -> float:
        """The room that the texts left of the axes take."""
        low, high = sorted(ax.get_ylim())
        ticks = [label.get_text() for place, label in zip(ax.get_yticks(), ax.get_yticklabels()) if low <= place <= high]
        label = TEXT / PIXEL + 10 if ax.get_ylabel() else 0
        return min(max((self.text_width(tick) for tick in ticks), default=0) + label + 8, 0.5 * self.width)

    def panels(self, count: int, columns: int = 0) -> list[Box]:
        """The boxes of `count` plots, in rows of `columns`; 0: as square as can be."""
        columns = columns or math.ceil(math.sqrt(count))
        rows = -(-count // columns)
        width = (self.width - MARGIN * (columns + 1)) / columns
        height = (self.height - MARGIN * (rows + 1)) / rows
        return [Box(MARGIN + k % columns * (width + MARGIN), MARGIN + k // columns * (height + MARGIN), width, height)
                for k in range(count)]

    def bytes(self, kind: str) -> bytes:
        """The file; the same for the same numbers."""
        changing = {"svg": ["Date", "Creator"], "pdf": ["CreationDate"], "png": ["Software"]}[kind]
        metadata = dict.fromkeys(changing)
        out = io.BytesIO()
        self.figure.savefig(out, format=kind, metadata=metadata, facecolor=self.theme.paper, dpi=96)
        return out.getvalue()


def _groups(album: dict[str, Any]) -> list[tuple[str, list[_curves.Curve]]]:
    """The runs of each graph, of a comparison or by themselves. Raises PlotError where there is none."""
    if album.get("bench"):
        groups = [(graph.name, [_curves.curve(each.name, each.initial_chi2, each.history) for each in graph.configurations if each.history])
                  for graph in _bench.read_bench(album["bench"])]
    else:
        groups = [(graph["name"], [_curves.curve(run["name"], run["chi2"]["initial"], run["iterations"]) for run in graph["runs"]])
                  for graph in album["graphs"]]
    groups = [(name, curves) for name, curves in groups if curves]
    if not groups:
        raise PlotError("no run to draw: give a recording, or the JSON that cairn optimize or cairn bench writes; of a CSV file columns "
                        "are drawn")
    return groups


def _choose(album: dict[str, Any]) -> str:
    if album.get("tables"):
        return "columns"
    if album.get("bench"):
        return "bars"
    return "trajectory" if any(graph["variables"]["count"] for graph in album["graphs"]) else "convergence"


def _against_time(x: str) -> bool:
    if x not in ("", "iterations", "time"):
        raise PlotError(f"x is '{x}', expected iterations or time: only CSV has columns", 2)
    return x == "time"


def _tables(album: dict[str, Any]) -> list[_curves.Table]:
    return [_curves.Table(table["name"], {column["name"]: array(column["values"]) for column in table["columns"]})
            for table in album.get("tables") or []]


def plots_of(numbers: dict[str, Any], theme: Theme) -> tuple[list[Plot], int]:
    """What the picture `json` has, as plots, and how many of them are in a row (0: as square as can be)."""
    options, album = numbers["options"], numbers["album"]
    what = options["what"] if options["what"] != "auto" else _choose(album)
    against_time = what != "columns" and _against_time(options["x"])
    if what == "trajectory":
        scenes = [scene(graph) for graph in album["graphs"]]
        how = _trajectory.Options(options["colour"] == "residual", options["poses"], options["ellipses"])
        return _trajectory.plots_of(scenes, theme, how), 0
    if what == "convergence":
        return [_curves.convergence(name, curves, against_time, theme) for name, curves in _groups(album)], 0
    if what == "steps":
        return [_curves.steps(name, curves, theme) for name, curves in _groups(album)], 0
    if what == "bars":
        return _bench.bars(_bench.read_bench(album.get("bench")), theme), 1
    if what == "scaling":
        plots = _bench.scaling(_bench.read_bench(album.get("bench")), theme)
        return plots, len(plots)
    if what == "sparsity":
        return _sparsity.plots_of(numbers["sparsity"], theme), 0
    if what == "columns":
        patterns = options["y_columns"].split("\n") if options["y_columns"] else []
        return _curves.columns(_tables(album), theme, options["x"], patterns, options["x_max"], options["logarithmic"].replace("none", "")), 0
    if not album["explorations"]:
        raise PlotError("no map to draw: give the recording of an exploration, as cairn explore --record RUN.jsonl writes it")
    states = [_exploration.state_of(each, options["decision"] or None) for each in album["explorations"]]
    return [_exploration.plot_of(state, theme, options["ellipses"] or _exploration.SIGMAS) for state in states], 0


def page_of(numbers: dict[str, Any]) -> Page:
    """The whole picture."""
    options = numbers["options"]
    theme = THEMES[options["theme"]]
    plots, columns = plots_of(numbers, theme)
    page = Page(options["width"], options["height"], theme)
    for box, plot in zip(page.panels(len(plots), columns), plots):
        page.add(box, plot)
    return page


def picture(numbers: dict[str, Any], kind: str) -> bytes:
    """The bytes of a file (svg, png or pdf) of what the picture `json` has. Raises PlotError where it cannot be drawn."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(RC)
        matplotlib.rcParams.update({"font.family": "DejaVu Sans", "svg.hashsalt": "cairn", "svg.fonttype": "path"})
        return page_of(numbers).bytes(kind)
