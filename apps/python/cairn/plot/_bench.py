# SPDX-License-Identifier: BSD-3-Clause
"""Comparisons of `cairn bench`: bars, and time and memory against size."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np
from matplotlib.axes import Axes

from ._axes import Names, Plot, printable
from ._curves import Chart, Line, plot_of
from ._numbers import PlotError
from ._theme import PIXEL, TEXT, Theme

ROW, WHISKER = 36, 3  # the most of a row, and half of what ends a whisker [px]
MEBIBYTE = 1024 * 1024


@dataclass
class Configuration:
    """One solver on one graph; median, low and high [s]."""

    name: str
    median: float = 0.0
    low: float = 0.0
    high: float = 0.0
    memory: float = 0.0  # peak [bytes]; 0: not measured
    initial_chi2: float = float("nan")
    history: list[dict[str, Any]] = field(default_factory=list)

    @property
    def ran(self) -> bool:
        return self.median > 0


@dataclass
class BenchGraph:
    """The configurations that ran on a graph of so many variables."""

    name: str
    variables: float
    configurations: list[Configuration]


def _number(value: Optional[dict[str, Any]], name: str) -> float:
    found = (value or {}).get(name)
    return float(found) if isinstance(found, (int, float)) else float("nan")


def _configuration(value: dict[str, Any]) -> Configuration:
    name = value.get("label") or ""
    if not name:  # reports of earlier versions
        solver = value.get("linear_solver") or "-"
        name = (value.get("optimizer") or "") + ("" if solver == "-" else f", {solver}")
    seconds = value.get("seconds")
    return Configuration(name, _number(seconds, "median"), _number(seconds, "min"), _number(seconds, "max"),
                         _number(value, "peak_memory_bytes"), _number(value.get("chi2"), "initial"), value.get("history") or [])


def read_bench(report: Optional[dict[str, Any]]) -> list[BenchGraph]:
    """The report of `cairn bench --json`. Raises PlotError where there is none."""
    if report is None:
        raise PlotError("no comparison to draw: give the JSON that cairn bench --json writes; of a CSV file columns are drawn")
    graphs = []
    for value in report.get("graphs") or []:
        about = value.get("graph") or {}
        configurations = [_configuration(each) for each in value.get("configurations") or []]
        graphs.append(BenchGraph(about.get("name") or about.get("file") or "", _number(about, "variables"), configurations))
    if not graphs:
        raise PlotError("the comparison has no graphs")
    return graphs


def time_text(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"


def _bars(graph: BenchGraph, theme: Theme) -> Plot:
    """One row a configuration: its name, a bar as long as its median, a whisker from fastest to slowest, the number."""
    rows = [(row, each) for row, each in enumerate(graph.configurations) if each.ran]
    texts: list[Any] = []

    def paint(ax: Axes, names: Names) -> None:
        for row, each in rows:
            [bar] = ax.barh(row, each.median, 0.64, color=(theme.series(row)).colour, linewidth=0)
            names.give(bar, "bar")
            whisker = {"color": theme.ink, "linewidth": PIXEL}
            ax.plot([each.low, each.high], [row, row], marker="|", markersize=2 * WHISKER * PIXEL, markeredgewidth=PIXEL, **whisker)
            texts.append(ax.annotate(time_text(each.median), (max(each.high, each.median), row), xytext=(8 * PIXEL, 0),
                                     textcoords="offset points", va="center", fontsize=TEXT, color=theme.ink))
        for row, each in enumerate(graph.configurations):
            if not each.ran:
                ax.annotate("did not run", (0, row), xytext=(4 * PIXEL, 0), textcoords="offset points", va="center",
                            fontsize=TEXT, color=theme.muted)
        ax.set_yticks(range(len(graph.configurations)), [printable(each.name) for each in graph.configurations])
        ax.tick_params(axis="y", labelcolor=theme.ink, length=0)
        ax.set_xticks([])
        ax.grid(False)
        ax.axvline(0, color=theme.muted, linewidth=PIXEL)
        ax.set_ylim(len(graph.configurations) - 0.5, -0.5)
        ax.set_xlabel("time of optimisation: median, fastest to slowest", loc="left", color=theme.muted)

    def fit(ax: Axes, width: float, _: float) -> None:
        widest = max((text.get_window_extent().width / ax.figure.dpi * 72 / PIXEL for text in texts), default=0.0)
        longest = max((each.high for _, each in rows), default=1e-12)
        ax.set_xlim(0, longest * width / max(width - widest - 12, 0.2 * width))

    return Plot(graph.name, paint, fit, equal=False, most_height=ROW * len(graph.configurations))


def bars(graphs: list[BenchGraph], theme: Theme) -> list[Plot]:
    return [_bars(graph, theme) for graph in graphs]


def scaling(graphs: list[BenchGraph], theme: Theme) -> list[Plot]:
    """Time and, where it was measured, peak memory of each solver against the number of variables, both axes logarithmic, so that a
    power law is a straight line."""
    seconds: dict[str, list[tuple[float, float]]] = {}
    memory: dict[str, list[tuple[float, float]]] = {}
    for graph in graphs:
        for each in graph.configurations:
            if each.ran:
                seconds.setdefault(each.name, []).append((graph.variables, each.median))
                memory.setdefault(each.name, [])
                if each.memory > 0:
                    memory[each.name].append((graph.variables, each.memory / MEBIBYTE))

    def panel(points: dict[str, list[tuple[float, float]]], title: str, label: str) -> Plot:
        lines = [Line(name, *np.array(sorted(each), dtype=float).reshape(-1, 2).T) for name, each in points.items()]
        return plot_of(Chart(title, "variables", label, logarithmic_x=True, logarithmic_y=True), lines, theme)

    plots = [panel(seconds, "Time of optimisation", "time [s]")]
    if any(memory.values()):
        plots.append(panel(memory, "Peak memory", "peak memory [MiB]"))
    return plots
