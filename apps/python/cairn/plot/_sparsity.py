# SPDX-License-Identifier: BSD-3-Clause
"""Where the system matrix H has blocks, and where its Cholesky factor L has."""
from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path

from ._axes import Names, Plot
from ._numbers import array
from ._theme import PIXEL, Theme


def runs(marked: np.ndarray) -> np.ndarray:
    """(row, first, end) of the cells that are marked side by side."""
    edge = np.diff(np.pad(marked.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    rows, first = np.nonzero(edge == 1)
    _, end = np.nonzero(edge == -1)
    return np.stack([rows, first, end], axis=1)


def _rectangles(pieces: np.ndarray) -> Path:
    """One rectangle a row high for each of the runs."""
    row, first, end = pieces.T
    corners = np.stack([first, row, end, row, end, row + 1, first, row + 1, first, row], axis=1).reshape(-1, 2)
    codes = np.tile([Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY], len(pieces))
    return Path(corners, codes)


def _plot(title: str, pattern: dict[str, Any], theme: Theme) -> Plot:
    cells = pattern["cells"]
    marked = array(pattern["marked"]).reshape(cells, cells) != 0

    def paint(ax: Axes, names: Names) -> None:
        names.give(ax.add_patch(PathPatch(_rectangles(runs(marked)), facecolor=theme.roles["estimate"].colour, linewidth=0)), "blocks")
        ax.add_patch(Rectangle((0, 0), cells, cells, facecolor="none", edgecolor=theme.muted, linewidth=PIXEL, clip_on=False))
        ax.set_xticks([])
        ax.set_yticks([])
        ax.grid(False)

    def fit(ax: Axes, width: float, height: float) -> None:
        side = min(width, height)
        ax.set_xlim(0, cells * width / side)
        ax.set_ylim(cells * height / side, 0)

    return Plot(title, paint, fit, bare=True,
                subtitle=f"{pattern['blocks']} blocks, {pattern['nonzeros']} nonzeros in the lower triangle")


def plots_of(sparsity: dict[str, Any], theme: Theme) -> list[Plot]:
    return [_plot(f"{sparsity['name']}: H", sparsity["H"], theme), _plot(f"L, ordering {sparsity['ordering']}", sparsity["L"], theme)]
