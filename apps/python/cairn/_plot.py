# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of graphs: by matplotlib, and in notebooks."""
import html

import numpy as np

from ._cairn import Error, Graph, components, draw, kinds


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


Graph.plot = plot
Graph._repr_html_ = _repr_html_
