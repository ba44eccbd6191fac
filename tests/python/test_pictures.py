# SPDX-License-Identifier: BSD-3-Clause
import html
import importlib.util
import json
import os
import re
import subprocess

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
import dense
from graphs import from_dense

needs_matplotlib = pytest.mark.skipif(
    not importlib.util.find_spec("matplotlib"), reason="there is no module matplotlib (python3-matplotlib)"
)

needs_plots = pytest.mark.skipif(
    "svg" not in cairn.components("picture") or not importlib.util.find_spec("matplotlib"), reason="no plugin draws SVG, or no matplotlib"
)


@pytest.fixture(autouse=True)
def no_screen():
    if importlib.util.find_spec("matplotlib"):
        import matplotlib

        matplotlib.use("Agg")
        yield
        from matplotlib import pyplot

        pyplot.close("all")
    else:
        yield


@needs_matplotlib
def test_a_planar_graph_is_drawn_where_its_variables_are():
    walk = dense.loop()
    graph = from_dense(walk)
    graph.add(cairn.L(0), cairn.Point2(2, 3))
    graph.add(cairn.Observation(4, cairn.L(0), cairn.Point2(1, 1)), sigmas=0.1)
    ax = graph.plot(color="red", label="estimate")
    lines = [np.array(line.get_data()).T for line in ax.get_lines()]
    edges, seen = lines[:2]
    assert_allclose(edges[0::3], walk.poses[[i for i, *_ in walk.edges], :2])
    assert_allclose(edges[1::3], walk.poses[[j for _, j, *_ in walk.edges], :2])
    assert np.isnan(edges[2::3]).all()
    assert_allclose(seen[:2], [walk.poses[4, :2], [2, 3]])
    assert_allclose(lines[2], walk.poses[:, :2])
    assert_allclose(lines[3], [[2, 3]])
    assert ax.get_xlabel() == "x [m]" and ax.get_legend_handles_labels()[1] == ["estimate"]
    assert graph.plot(ax, factors=False) is ax
    assert len(ax.get_lines()) == 4 + 2


@needs_matplotlib
def test_a_graph_in_space_is_drawn_in_three_dimensions(tmp_path):
    graph, _ = cairn.generate("sphere", seed=1, turns=3)
    ax = graph.plot()
    assert ax.name == "3d" and ax.get_zlabel() == "z [m]"
    ax.figure.savefig(tmp_path / "sphere.png")
    assert (tmp_path / "sphere.png").stat().st_size > 5000


@needs_matplotlib
def test_what_has_no_positions_cannot_be_drawn():
    with pytest.raises(cairn.Error, match="no poses and no points"):
        cairn.Graph().plot()


@needs_plots
def test_files_are_drawn():
    graph, truth = cairn.generate("manhattan", seed=1, poses=200)
    picture = cairn.draw({"drifted": graph, "truth": truth}, "svg", width=400, height=300)
    assert picture.startswith(b"<?xml") and b'viewBox="0 0 300 225"' in picture  # points
    assert cairn.draw({"graph": graph}, "png").startswith(b"\x89PNG")
    with pytest.raises(cairn.Error, match="picture"):
        cairn.draw({"graph": graph}, "jpeg")


def drawn_numbers(ax):
    """Those of all lines, in the order in which they are drawn [m]."""
    return np.concatenate([np.array(line.get_data()).T for line in sorted(ax.get_lines(), key=lambda line: line.get_zorder())])


def ellipses_of(ax):
    """The corners (24, 2) of each ellipse in the thin stroke of covariances [m]."""
    thin = max((line for line in ax.get_lines() if line.get_linewidth() == 0.7 * 0.75), key=lambda line: len(line.get_xdata()))
    return np.array(thin.get_data()).T.reshape(-1, 26, 2)[:, :24]


def scenes_of(numbers):
    """The positions of each estimate in what `cairn plot` draws."""
    from cairn.plot import _numbers

    return [_numbers.scene(graph) for graph in json.loads(numbers)["album"]["graphs"]]


@needs_plots
@pytest.mark.parametrize("name, pose, motion", [
    (dict(generator="manhattan", poses=200), cairn.Pose2, cairn.Pose2(30, -10, 2)),
    (dict(generator="sphere", turns=3), cairn.Pose3, cairn.Pose3.exp([5, -30, 8, 0.4, -1, 0.3])),
])
def test_an_estimate_is_aligned_to_the_truth(name, pose, motion, tmp_path):
    graph, truth = cairn.generate(seed=1, **name)
    turned = graph.copy()
    turned.set_states(pose, [(motion * pose.from_state(row)).state for row in graph.states(pose)])
    expected = drawn_numbers(cairn.plot.trajectory({"estimate": graph}, truth=truth))
    aligned = drawn_numbers(cairn.plot.trajectory({"estimate": turned}, truth=truth))
    assert_allclose(aligned, expected, atol=1e-4)
    truth.write(tmp_path / "truth.g2o")
    for name, each in [("plain", graph), ("turned", turned)]:
        each.write(tmp_path / "map.g2o")
        command = [os.environ["CAIRN_PROGRAM"], "plot", "map.g2o", "--truth", "truth.g2o", "-o", f"{name}.json", "--quiet"]
        subprocess.run(command, cwd=tmp_path, check=True)
    [of_turned], [of_plain] = (scenes_of((tmp_path / f"{name}.json").read_bytes()) for name in ("turned", "plain"))
    for one, other in zip(of_turned.estimates, of_plain.estimates):
        assert_allclose(one.positions, other.positions, atol=1e-3)
    apart = scenes_of(cairn.draw({"estimate": turned, "truth": truth}, "json"))
    assert np.abs(apart[0].estimates[0].positions - of_plain.estimates[0].positions).max() > 5


@needs_plots
def test_covariances_are_drawn_as_ellipses():
    graph, truth = cairn.generate("manhattan", seed=1, poses=60)
    cairn.optimize(graph)
    ids = graph.ids(cairn.Pose2)[1:]
    covariances = {"estimate": (ids, cairn.marginals(graph, ids))}
    three = ellipses_of(cairn.plot.trajectory({"estimate": graph}, covariances=covariances))
    assert len(three) == len(ids)
    # Each has the shape of the covariance of the position in the world: R S R^T.
    states = graph.states(cairn.Pose2)[1:]
    for corners, (x, y, heading), block in zip(three, states, covariances["estimate"][1]):
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        world = turn @ block[:2, :2] @ turn.T
        deviation = corners - [x, y]
        assert_allclose(deviation.T @ deviation / (24 / 2 * 9), world, rtol=0.01, atol=1e-6)  # of 24 corners at 3 sigma
    one = ellipses_of(cairn.plot.trajectory({"estimate": graph}, covariances=covariances, ellipses=1))
    assert_allclose(np.ptp(one, axis=1), np.ptp(three, axis=1) / 3, atol=1e-6)
    picture = cairn.draw({"estimate": graph}, covariances=covariances)
    assert b'<g id="covariances">' in picture and b"<!-- covariance, 3 " in picture
    sphere, _ = cairn.generate("sphere", seed=1, turns=3)
    ids = sphere.ids(cairn.Pose3)[1:]
    in_space = cairn.plot.trajectory({"e": sphere}, covariances={"e": (ids, cairn.marginals(sphere, ids))})
    assert len(ellipses_of(in_space)) == len(ids)


@needs_plots
def test_covariances_that_do_not_fit_are_refused():
    graph, _ = cairn.generate("manhattan", seed=1, poses=20)
    for given, message in [
        ({"other": ([1], np.eye(3)[None])}, "there is no graph of the name 'other'"),
        ({"graph": np.eye(3)[None]}, "expected ids and their covariances"),
        ({"graph": ([1, 2], np.eye(3)[None])}, r"the shape is \(1, 3, 3\), expected \(2, d, d\)"),
        ({"graph": ([1, 2], [np.eye(3), np.diag([1, -1, 1])])}, r"covariances\['graph'\]: .* variable 2 has the negative variance -1"),
        ({"graph": ([1], np.full((1, 3, 3), np.nan))}, "variable 1 has a number that is not finite"),
        ({"graph": ([999], np.eye(3)[None])}, "there is no variable 999"),
        ({"graph": ([1], np.eye(2)[None])}, "blocks of 2 x 2 for variable 1, whose covariance is 3 x 3"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            cairn.draw({"graph": graph}, covariances=given)


def test_values_of_other_types_cannot_be_drawn():
    graph, _ = cairn.generate("manhattan", seed=1, poses=20)
    for arguments, message in [
        (dict(graphs={"t": "x"}), r"graphs\['t'\]: expected a cairn.Graph, not a value of type str"),
        (dict(graphs={"t": graph}, truth="truth.g2o"), "truth: expected a cairn.Graph, not a value of type str"),
        (dict(graphs={"t": graph}, truth=5), "truth: expected a cairn.Graph, not a value of type int"),
        (dict(graphs={"t": graph}, covariances=5), r"covariances: expected ids and covariances .*not a value of type int"),
    ]:
        with pytest.raises(TypeError, match=message):
            cairn.draw(**arguments)
    with pytest.raises(cairn.Error, match="there is no graph to draw"):
        cairn.draw({}, "svg")


@pytest.mark.skipif("html" not in cairn.components("picture"), reason="no plugin makes pages")
def test_a_notebook_shows_the_page():
    graph, _ = cairn.generate("manhattan", seed=1, poses=50)
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', graph._repr_html_()).group(1))
    assert page.lstrip().lower().startswith("<!doctype html") and "cairn-data" in page
    assert cairn.Graph()._repr_html_() is None
