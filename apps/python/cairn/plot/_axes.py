# SPDX-License-Identifier: BSD-3-Clause
"""What every plot needs of axes: limits, ticks, a legend, names for what is drawn."""
from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Callable, Optional

import numpy as np
from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ._theme import PIXEL, TEXT, Stroke, Theme

RC = {  # whatever the user's own settings are
    "lines.scale_dashes": False, "lines.dash_capstyle": "butt", "path.simplify": True, "agg.path.chunksize": 20000,
    "axes.unicode_minus": False, "axes.formatter.useoffset": False, "text.usetex": False,
}


@dataclass
class Plot:
    """One chart, before it is on axes.

    `paint` adds the data; `fit` sets what depends on the size of the axes in pixels, and may be called again.
    """

    title: str
    paint: Callable[[Axes, "Names"], None]
    fit: Callable[[Axes, float, float], None] = lambda ax, width, height: None
    legend: list[tuple[str, Stroke]] = field(default_factory=list)
    subtitle: str = ""
    bare: bool = False  # no axes, such as of a graph in space
    equal: bool = True  # as many pixels a metre on both axes
    most_height: float = math.inf  # [px]


class Names:
    """The ids that parts of a picture get, in SVG attributes: "estimate", "estimate-2", …; none in axes of the user."""

    def __init__(self, wanted: bool = True):
        self._seen: Optional[dict[str, int]] = {} if wanted else None

    def give(self, artist: Any, name: str) -> Any:
        if self._seen is not None:
            name = re.sub("[^A-Za-z0-9_]+", "-", name).strip("-") or "series"
            count = self._seen[name] = self._seen.get(name, 0) + 1
            artist.set_gid(name if count == 1 else f"{name}-{count}")
        return artist


def printable(text: str) -> str:
    """Names come from files: anything may stand in them. A dollar begins no formula."""
    return re.sub(r"[\x00-\x1f\x7f]", " ", str(text)).replace("$", r"\$")


def draw_line(ax: Axes, names: Names, name: str, x: Any, y: Any, stroke: Stroke, zorder: float = 2, **more: Any) -> Line2D:
    """A line, with gaps where a number is NaN."""
    [line] = ax.plot(x, y, zorder=zorder, scalex=False, scaley=False, **{**stroke.line(), **more})
    return names.give(line, name)


def draw_marks(ax: Axes, names: Names, name: str, points: np.ndarray, colour: Any, marker: str, size: float,
               zorder: float = 2) -> Line2D:
    """A mark of that size [px] at each of the points (n, 2)."""
    [line] = ax.plot(points[:, 0], points[:, 1], linestyle="none", marker=marker, markersize=size * PIXEL, markerfacecolor=colour,
                     markeredgewidth=0, zorder=zorder, scalex=False, scaley=False)
    return names.give(line, name)


def range_of(values: np.ndarray, logarithmic: bool = False) -> tuple[float, float]:
    """An interval that holds all values that can be shown, with a little room round them."""
    values = np.asarray(values, dtype=float).ravel()
    values = values[np.isfinite(values) & ((values > 0) | (not logarithmic))]
    if not values.size:
        return (1.0, 10.0) if logarithmic else (0.0, 1.0)
    low, high = float(values.min()), float(values.max())
    if logarithmic:
        room = max((high / low) ** 0.04, 1.05)
        return low / room, high * room
    room = 0.03 * (high - low) if high > low else max(abs(high) * 0.1, 0.5)
    return low - room, high + room


def tick_text(value: float, _: Any = None) -> str:
    """1200, 0.05, 1e-7."""
    size = abs(value)
    if size != 0 and (size >= 1e6 or size < 1e-3):
        exponent = math.floor(math.log10(size) + 1e-9)
        return f"{value / 10.0 ** exponent:g}e{exponent}"
    return f"{value:.6g}"


def locator(low: float, high: float, logarithmic: bool, count: int, whole: bool = False) -> ticker.Locator:
    """Ticks at 1, 2 or 5 times a power of ten, about `count` of them; of many decades at powers of ten alone."""
    decades = math.log10(high / low) if logarithmic else 0.0
    if decades >= 1:
        return ticker.LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.5 else (1.0,), numticks=max(count, 2) + 1 if decades >= 2.5 else 20)
    return ticker.MaxNLocator(nbins=max(count, 1), steps=[1, 2, 5, 10], integer=whole, min_n_ticks=2 if whole else 1)


def set_ticks(ax: Axes, width: float, height: float, whole_x: bool = False) -> None:
    """Ticks that are neither dense nor few, for axes of that size [px]."""
    for axis, size, each, limits, whole in [(ax.xaxis, width, 90, ax.get_xlim(), whole_x), (ax.yaxis, height + 40, 60, ax.get_ylim(), False)]:
        logarithmic = axis.get_scale() == "log"
        axis.set_major_locator(locator(min(limits), max(limits), logarithmic, max(2, int(size / each)), whole))
        axis.set_major_formatter(ticker.FuncFormatter(tick_text))
        axis.set_minor_locator(ticker.NullLocator())


def style_axes(ax: Axes, theme: Theme) -> None:
    """A grid and no frame."""
    for spine in ax.spines.values():
        spine.set_visible(False)
    ax.set_facecolor("none")
    ax.set_axisbelow(True)
    ax.grid(True, color=theme.grid, linewidth=PIXEL, linestyle="solid")
    ax.tick_params(which="major", length=4 * PIXEL, width=PIXEL, color=theme.grid, labelcolor=theme.muted, labelsize=TEXT, pad=4 * PIXEL)
    for label in (ax.xaxis.label, ax.yaxis.label):
        label.set(color=theme.ink, fontsize=TEXT)


def equal_limits(ax: Axes, bounds: np.ndarray, width: float, height: float) -> None:
    """Limits round the bounds ((x, y) of the least and the most), with as many pixels a metre on both axes and some room."""
    extent = bounds[1] - bounds[0]
    room = 0.03 * max(float(extent.max()), 1e-6)
    metres = max((extent[0] + 2 * room) / width, (extent[1] + 2 * room) / height)
    middle = bounds.mean(0)
    ax.set_xlim(middle[0] - metres * width / 2, middle[0] + metres * width / 2)
    ax.set_ylim(middle[1] - metres * height / 2, middle[1] + metres * height / 2)


def bounds_of(points: Iterable[np.ndarray]) -> Optional[np.ndarray]:
    """The least and the most x and y of points (n, 2), of which some may not be there; None: none is."""
    every = np.concatenate([np.zeros((0, 2)), *(each[:, :2] for each in points)])
    every = every[np.isfinite(every).all(1)]
    return np.array([every.min(0), every.max(0)]) if len(every) else None


def chain(a: np.ndarray, b: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The edges from points[a] to points[b] as one line (m, 2) with gaps. Those that go on where the last ended are one piece, so
    that dashes go round corners."""
    there = np.isfinite(points).all(1)
    keep = (b >= 0) & there[a] & there[b]
    a, b = a[keep], b[keep]
    if not a.size:
        return np.zeros((0, 2))
    begins = np.concatenate([[True], a[1:] != b[:-1]])
    place = np.cumsum(np.where(begins, 3, 1)) - 1  # of each b; a and the gap before it stand before
    line = np.full((place[-1] + 1, 2), np.nan)
    line[place] = points[b]
    line[place[begins] - 1] = points[a[begins]]
    return line[1:]


CORNERS = 24  # of an ellipse


def ellipse(covariance: np.ndarray, sigmas: float) -> np.ndarray:
    """The corners (25, 2) of an ellipse round 0, the first again at the end; none for what is no covariance.

    The unit circle by a Cholesky factor of the covariance: any square root of it makes the same ellipse.
    """
    (xx, xy), (_, yy) = covariance
    if not (np.isfinite([xx, xy]).all() and xx >= 0 and yy >= 0):
        return np.zeros((0, 2))
    l11 = math.sqrt(xx)
    l21 = xy / l11 if l11 > 0 else 0.0
    l22 = math.sqrt(max(0.0, yy - l21 * l21))
    angle = 2 * np.pi * np.arange(CORNERS + 1) / CORNERS
    angle[-1] = 0.0
    u, v = sigmas * np.cos(angle), sigmas * np.sin(angle)
    return np.stack([l11 * u, l21 * u + l22 * v], axis=1)
