# SPDX-License-Identifier: BSD-3-Clause
"""Lines on two axes: convergence, time of each step, columns of tables."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Optional

import numpy as np
from matplotlib.axes import Axes

from ._axes import Names, Plot, draw_line, printable, range_of, set_ticks
from ._numbers import PlotError
from ._theme import PIXEL, Theme

DOTS = 100  # more points than these are a line without dots


@dataclass
class Line:
    """Points in order; what is not finite, or not positive on a logarithmic axis, is a gap."""

    name: str
    x: np.ndarray
    y: np.ndarray


@dataclass
class Chart:
    """Title, axes, and which of them are logarithmic; `whole_x`: only integers have a meaning, such as those of iterations."""

    title: str
    x_label: str
    y_label: str
    logarithmic_x: bool = False
    logarithmic_y: bool = True
    whole_x: bool = False

    def shown(self, line: Line) -> np.ndarray:
        """Which points can be drawn."""
        shown = np.isfinite(line.x) & np.isfinite(line.y)
        return shown & ((line.x > 0) | (not self.logarithmic_x)) & ((line.y > 0) | (not self.logarithmic_y))


def plot_of(chart: Chart, lines: Sequence[Line], theme: Theme) -> Plot:
    """The lines, each in a colour and dash of its own, with dots where there are few points."""
    def paint(ax: Axes, names: Names) -> None:
        ax.set_xscale("log" if chart.logarithmic_x else "linear")
        ax.set_yscale("log" if chart.logarithmic_y else "linear")
        for number, line in enumerate(lines):
            shown, stroke = chart.shown(line), theme.series(number)
            dots = {"marker": "o", "markersize": 4 * PIXEL, "markeredgewidth": 0} if len(line.x) <= DOTS else {}
            draw_line(ax, names, line.name, np.where(shown, line.x, np.nan), np.where(shown, line.y, np.nan), stroke, 2, **dots)
        ax.set_xlim(range_of(np.concatenate([np.zeros(0), *(line.x for line in lines)]), chart.logarithmic_x))
        ax.set_ylim(range_of(np.concatenate([np.zeros(0), *(line.y for line in lines)]), chart.logarithmic_y))
        ax.set_xlabel(printable(chart.x_label))
        ax.set_ylabel(printable(chart.y_label))

    def fit(ax: Axes, width: float, height: float) -> None:
        set_ticks(ax, width, height, chart.whole_x)

    return Plot(chart.title, paint, fit, [(line.name, theme.series(number)) for number, line in enumerate(lines)], equal=False)


@dataclass
class Curve:
    """One run: chi2 after iterations 0, 1, … and the seconds of iterations 1, 2, …"""

    name: str
    chi2: np.ndarray
    seconds: np.ndarray


def curve(name: str, initial_chi2: Any, iterations: Sequence[dict[str, Any]]) -> Curve:
    def numbers(values: Sequence[Any]) -> np.ndarray:
        return np.array([np.nan if value is None else value for value in values], dtype=float)

    chi2 = [initial_chi2, *(each.get("chi2") for each in iterations)]
    return Curve(name, numbers(chi2), numbers([each.get("seconds") for each in iterations]))


def _title(group: str, what: str) -> str:
    return f"{group}: {what}" if group else what


def convergence(group: str, curves: Sequence[Curve], against_time: bool, theme: Theme) -> Plot:
    """chi2 against iterations or time."""
    def line(each: Curve) -> Line:
        time = np.concatenate([[0.0], np.cumsum(each.seconds)])
        return Line(each.name, time if against_time else np.arange(len(each.chi2), dtype=float), each.chi2)

    chart = Chart(_title(group, "convergence"), "time [s]" if against_time else "iteration", "χ² (logarithmic)", whole_x=not against_time)
    return plot_of(chart, [line(each) for each in curves], theme)


def steps(group: str, curves: Sequence[Curve], theme: Theme) -> Plot:
    """Milliseconds of each iteration."""
    lines = [Line(each.name, np.arange(1, len(each.seconds) + 1, dtype=float), 1e3 * each.seconds) for each in curves]
    return plot_of(Chart(_title(group, "time of each step"), "iteration", "time [ms] (logarithmic)", whole_x=True), lines, theme)


@dataclass
class Table:
    """Named columns of equally many numbers; NaN where a field is none."""

    name: str
    columns: dict[str, np.ndarray]

    def horizontal(self, name: str) -> str:
        """The column of that name, or the first."""
        if name and name not in self.columns:
            raise PlotError(f"{self.name} has no column '{name}'; it has {', '.join(self.columns)}", 2)
        name = name or next(iter(self.columns))
        if not np.isfinite(self.columns[name]).any():
            raise PlotError(f"column '{name}' of {self.name} has no number")
        return name

    def selected(self, x: str, pattern: str) -> list[str]:
        """Those with numbers that a pattern selects, but for the horizontal axis."""
        return [name for name, values in self.columns.items()
                if name != x and np.isfinite(values).any() and fnmatchcase(name, pattern)]


def _common(pattern: str) -> str:
    """The words before the one * of a pattern, such as "map_error" of "map_error *", which columns of several methods begin with."""
    only = pattern.endswith(" *") and not any(sign in pattern[:-1] for sign in "*?[")
    return pattern[:-2] if only else ""


def _columns(tables: Sequence[Table], x: str, pattern: str, x_max: float, logarithmic: str, theme: Theme) -> Plot:
    """Lines are named after what tells them apart: the column, the table, or both."""
    common = _common(pattern)
    chosen = [(table, table.horizontal(x)) for table in tables]
    selected = [table.selected(across, pattern) for table, across in chosen]
    one_each = bool(common) and all(len(names) == 1 for names in selected)
    lines, every = [], dict.fromkeys(name for names in selected for name in names)
    for (table, across), names in zip(chosen, selected):
        for name in names:
            label = name if len(tables) == 1 else table.name if one_each else f"{table.name}: {name}"
            keep = ~(table.columns[across] > x_max)
            lines.append(Line(label, table.columns[across][keep], table.columns[name][keep]))
    if not lines:
        raise PlotError(f"no column with numbers matches '{pattern}'; {tables[0].name} has {', '.join(tables[0].columns)}", 2)
    what = common or (", ".join(every) if len(every) <= 3 else tables[0].name if pattern == "*" else pattern)
    across = chosen[-1][1]
    chart = Chart(f"{what} against {across}", across, next(iter(every)) if len(every) == 1 else common, "x" in logarithmic,
                  "y" in logarithmic)
    if not any(chart.shown(line).any() for line in lines):
        raise PlotError(f"{chart.title}: no point can be drawn: logarithmic axes have positive numbers only, and what is beyond the "
                        "right end is left out")
    return plot_of(chart, lines, theme)


def columns(tables: Sequence[Table], theme: Theme, x: str = "", patterns: Sequence[str] = (), x_max: Optional[float] = None,
            logarithmic: str = "") -> list[Plot]:
    """A chart for each pattern (with * and ?), or one of all columns; `logarithmic` holds "x" and "y"."""
    if not tables:
        raise PlotError("no columns to draw: give CSV, such as cairn replay --steps writes")
    right = np.inf if x_max is None else x_max
    return [_columns(tables, x, pattern, right, logarithmic, theme) for pattern in patterns or ["*"]]
