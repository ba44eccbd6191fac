# SPDX-License-Identifier: BSD-3-Clause
"""Plots on axes of matplotlib: what `cairn plot` draws, for notebooks and papers.

    import cairn

    ax = cairn.plot.trajectory({"estimate": graph}, truth=truth)
    ax.figure.savefig("trajectory.pdf")

Each function draws on `ax`, or on new axes of pyplot, and returns the axes. What cannot be drawn raises `cairn.Error`.
`theme` is "light" or "dark": colours for such paper. Matplotlib is imported by the first plot.
"""
import contextlib
import json

import numpy as np

from .._cairn import Error
from .._cairn import draw as _draw

__all__ = ["bars", "columns", "convergence", "exploration", "scaling", "sparsity", "steps", "trajectory"]


@contextlib.contextmanager
def _drawing():
    """Settings that every plot needs, and errors as all others of cairn."""
    import matplotlib

    from ._axes import RC
    from ._numbers import PlotError

    try:
        with matplotlib.rc_context(RC):
            yield
    except PlotError as error:
        raise Error(str(error)) from None


def _theme_named(name):
    from ._theme import THEMES

    if name not in THEMES:
        raise Error(f"theme is '{name}', expected light or dark")
    return THEMES[name]


def _new_axes(count=1):
    from matplotlib import pyplot

    figure = pyplot.figure()
    return [figure.add_subplot(1, count, k + 1) for k in range(count)]


def _put(plot, ax, theme):
    """A plot on axes, with its title and legend."""
    from matplotlib.lines import Line2D

    from ._axes import Names, printable, style_axes

    if ax is None:
        [ax] = _new_axes()
    style_axes(ax, theme)
    plot.paint(ax, Names(False))
    size = ax.get_window_extent()
    pixels = 96 / ax.figure.dpi
    plot.fit(ax, size.width * pixels, size.height * pixels)
    if plot.equal:  # also when the figure gets another size
        ax.set_aspect("equal", adjustable="datalim")
    if plot.bare:
        ax.axis("off")
    ax.set_title("\n".join(filter(None, [printable(plot.title), plot.subtitle])), color=theme.ink)
    if plot.legend:
        ax.legend([Line2D([], [], **stroke.line()) for _, stroke in plot.legend], [printable(name) for name, _ in plot.legend])
    return ax


def _only(plots, number, what):
    if not 0 <= number < len(plots):
        raise Error(f"there is no {what} {number}; expected 0 to {len(plots) - 1}")
    return plots[number]


def _report(report):
    """A report that is one, or the file that has it."""
    if isinstance(report, dict):
        return report
    with open(report, encoding="utf-8") as file:
        return json.load(file)


def trajectory(graphs, ax=None, *, truth=None, covariances=None, colour="class", poses=False, ellipses=None, theme="light"):
    """Graphs with the same ids over each other: poses, loop closures, landmarks. One in space is seen from the side.

    graphs: a Graph, or one for each name, {"estimate": graph, "initial": other}.
    truth: a Graph of where the poses truly are; each estimate is aligned to it, as `cairn.evaluate` does.
    covariances: for a name the ids of variables and their covariances, {"estimate": (ids, cairn.marginals(graph, ids))}.
    colour: what edges are coloured by, "class" or "residual".
    poses: whether each pose has a mark.
    ellipses: standard deviations of the ellipses of covariances, 3 unless another number is given; 0: none.
    """
    with _drawing():
        from . import _trajectory
        from ._numbers import scene

        if colour not in ("class", "residual"):
            raise Error(f"colour is '{colour}', expected class or residual")
        named = graphs if isinstance(graphs, dict) else {"graph": graphs}
        numbers = json.loads(_draw(named, "json:what=trajectory", truth=truth, covariances=covariances))
        scenes = [each for each in map(scene, numbers["album"]["graphs"]) if each.estimates]
        if len(scenes) != 1:
            names = ", ".join(each.name for each in scenes)
            raise Error(f"graphs without ids in common are not over each other; draw one at a time: {names}")
        sigmas = (3.0 if covariances else 0.0) if ellipses is None else ellipses
        options = _trajectory.Options(colour == "residual", poses, sigmas)
        return _put(_trajectory.plot_of(scenes[0], _theme_named(theme), options), ax, _theme_named(theme))


def sparsity(graph, axes=None, *, linear_solver="block_cholesky", theme="light"):
    """Where the system matrix H has blocks, and where its Cholesky factor L has, in the order in which a linear solver eliminates.

    axes: two, for H and L; None: new ones. Returns both.
    """
    with _drawing():
        from . import _sparsity

        numbers = json.loads(_draw({"graph": graph}, "json", what="sparsity", linear_solver=linear_solver))
        plots = _sparsity.plots_of(numbers["sparsity"], _theme_named(theme))
        return tuple(_put(plot, ax, _theme_named(theme)) for plot, ax in zip(plots, _new_axes(2) if axes is None else axes))


def _run_curves(runs):
    """Summaries, or the iterations of reports, as curves."""
    from ._curves import Curve, curve

    def one(name, run):
        if not hasattr(run, "iterations"):
            report = _report(run)
            return curve(name, report["chi2"]["initial"], report["iterations"])
        chi2 = [run.initial_chi2, *(each.chi2 for each in run.iterations)]
        return Curve(name, np.array(chi2, dtype=float), np.array([each.seconds for each in run.iterations], dtype=float))

    if not runs:
        raise Error("there is no run to draw; expected a Summary for each name, {\"dogleg\": summary}")
    return [one(name, run) for name, run in runs.items()]


def convergence(runs, ax=None, *, x="iterations", theme="light"):
    """chi2 of each run against iterations or time.

    runs: for each name a Summary of `cairn.optimize`, or the report of `cairn optimize --json`: a dict or its file.
    x: "iterations" or "time".
    """
    with _drawing():
        from . import _curves as curves

        if x not in ("iterations", "time"):
            raise Error(f"x is '{x}', expected iterations or time")
        return _put(curves.convergence("", _run_curves(runs), x == "time", _theme_named(theme)), ax, _theme_named(theme))


def steps(runs, ax=None, *, theme="light"):
    """Time of each iteration of each run; `runs` as for `convergence`."""
    with _drawing():
        from . import _curves as curves

        return _put(curves.steps("", _run_curves(runs), _theme_named(theme)), ax, _theme_named(theme))


def columns(tables, ax=None, *, x="", y="*", x_max=None, log="", theme="light"):
    """Columns of numbers against one of them.

    tables: {"run": {"distance": numbers, "map_entropy": numbers}}: for each name a table, which may be a DataFrame of pandas.
    x: the column across, "": the first. y: a pattern with * and ? of those that are drawn.
    x_max: rows beyond are left out. log: logarithmic axes, "", "x", "y" or "xy".
    """
    with _drawing():
        from . import _curves as curves

        every = [curves.Table(name, {str(column): np.asarray(table[column], dtype=float) for column in table})
                 for name, table in tables.items()]
        [plot] = curves.columns(every, _theme_named(theme), x, [y], x_max, log)
        return _put(plot, ax, _theme_named(theme))


def bars(report, ax=None, *, graph=0, theme="light"):
    """Median times of a comparison, with their spread.

    report: of `cairn bench --json`, a dict or its file. graph: which of its graphs.
    """
    with _drawing():
        from . import _bench

        plots = _bench.bars(_bench.read_bench(_report(report)), _theme_named(theme))
        return _put(_only(plots, graph, "graph"), ax, _theme_named(theme))


def scaling(report, ax=None, *, memory=False, theme="light"):
    """Time, or peak memory, of each solver of a comparison against the number of variables, both logarithmic.

    report: of `cairn bench --json`, a dict or its file.
    """
    with _drawing():
        from . import _bench

        plots = _bench.scaling(_bench.read_bench(_report(report)), _theme_named(theme))
        if memory and len(plots) < 2:
            raise Error("the memory of this comparison was not measured")
        return _put(plots[int(memory)], ax, _theme_named(theme))


def exploration(recording, ax=None, *, decision=None, ellipses=3.0, theme="light"):
    """Map, graph and newest scan of a robot at the end of an exploration, or at a decision, with what was to choose from.

    recording: the file of `cairn explore --record`, or its lines, each a dict.
    ellipses: standard deviations of the covariance of the robot's position.
    """
    with _drawing():
        from . import _exploration

        name = "exploration"
        if isinstance(recording, (list, tuple)):
            lines = list(recording)
        else:
            name = str(recording)
            with open(recording, encoding="utf-8") as file:
                lines = [json.loads(line) for line in file]
        state = _exploration.state_of({"name": name, "header": lines[0] if lines else {}, "lines": lines[1:]}, decision)
        return _put(_exploration.plot_of(state, _theme_named(theme), ellipses), ax, _theme_named(theme))
