# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of graphs: by matplotlib, and in notebooks."""
import html
import json

import numpy as np

from ._cairn import Error, Graph, components, kinds
from ._cairn import draw as _draw


def _positions(graph, tag):
    """Positions [m] of all variables of a type, (n, 2) or (n, 3); None for a type that has none."""
    states = graph.states(tag)
    if tag in ("VERTEX_SE2", "VERTEX_XY"):
        return states[:, :2]
    if tag in ("VERTEX_SE3:QUAT", "VERTEX_TRACKXYZ"):
        return states[:, :3]
    return None


def plot(self, ax=None, *, color=None, label=None, factors=True):
    """Draws the poses, points and factors of a graph with matplotlib; returns the axes.

    ax: axes to draw on, of projection "3d" for a graph in space; None: new ones.
    color, label: of the poses.
    factors: whether to draw the factors between two variables as lines.
    """
    from matplotlib import pyplot

    places = {tag: _positions(self, tag) for tag in self.variable_types}
    places = {tag: positions for tag, positions in places.items() if positions is not None}
    if not places:
        raise Error("nothing of this graph has a position: no poses and no points")
    dimension = max(positions.shape[1] for positions in places.values())
    if ax is None:
        ax = pyplot.figure().add_subplot(**({"projection": "3d"} if dimension == 3 else {}))
    places = {tag: np.pad(p, ((0, 0), (0, dimension - p.shape[1]))) for tag, p in places.items()}

    ids = np.concatenate([self.ids(tag) for tag in places])
    every = np.concatenate(list(places.values()))
    order = np.argsort(ids)
    for tag in self.factor_types if factors else []:
        ends = self.factor_ids(tag)
        if ends.shape[1] != 2 or not np.isin(ends, ids).all():
            continue
        lines = every[order[np.searchsorted(ids[order], ends)]]
        # One line with gaps is drawn much faster than many lines.
        gaps = np.concatenate([lines, np.full((len(lines), 1, dimension), np.nan)], axis=1).reshape(-1, dimension)
        ax.plot(*gaps.T, color="0.75", linewidth=0.6, zorder=1)
    for tag, positions in places.items():
        is_pose = tag in ("VERTEX_SE2", "VERTEX_SE3:QUAT")
        style = {"color": color, "marker": ".", "markersize": 3} if is_pose else {"color": "0.3", "marker": "x", "markersize": 4}
        ax.plot(*positions.T, linestyle="none", label=label if is_pose else None, zorder=2, **style)
    for axis in "xyz"[:dimension]:
        getattr(ax, f"set_{axis}label")(f"{axis} [m]")
    ax.set_aspect("equal")
    return ax


def _repr_html_(self):
    """The page of `cairn view`, for notebooks; None where the plugin that writes it is missing."""
    if "picture" not in kinds() or "html" not in components("picture") or not self.variable_count:
        return None
    page = draw({"graph": self}, "html").decode()
    return f'<iframe srcdoc="{html.escape(page)}" width="100%" height="600" frameborder="0"></iframe>'


def draw(graphs, picture="svg", *, truth=None, covariances=None, **options):
    """Graphs drawn: the bytes of a file.

    graphs: a Graph for each name, {"estimate": graph, "truth": other}; those with the same ids are laid over each other, the
        first of those without factors as the truth.
    picture: "svg", "png" or "pdf", drawn by matplotlib, "json", the numbers of that, or "html" (the page of cairn view); a
        name of `cairn.components("picture")`, whose options are further keyword arguments.
    truth: a Graph of where the poses truly are; each estimate is aligned to it, as `cairn.evaluate` does.
    covariances: for a name the ids of variables and their covariances, {"estimate": (ids, cairn.marginals(graph, ids))}, drawn as
        ellipses of their positions, of ellipsoids in space the outlines, of 3 standard deviations unless ellipses= says another number.
    """
    kind, colon, given = picture.partition(":") if isinstance(picture, str) else (picture, "", "")
    if kind not in ("svg", "png", "pdf") or kind not in components("picture"):
        return _draw(graphs, picture, truth=truth, covariances=covariances, **options)
    numbers = json.loads(_draw(graphs, f"json{colon}{given}", truth=truth, covariances=covariances, **options))
    from .plot._numbers import PlotError
    from .plot._page import picture as drawn

    try:
        return drawn(numbers, kind)
    except PlotError as error:
        raise Error(str(error)) from None


Graph.plot = plot
Graph._repr_html_ = _repr_html_
