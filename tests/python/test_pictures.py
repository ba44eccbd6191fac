# SPDX-License-Identifier: BSD-3-Clause
import html
import importlib.util
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


@pytest.mark.skipif("svg" not in cairn.components("picture"), reason="no plugin draws SVG")
def test_plugins_draw_too():
    graph, truth = cairn.generate("manhattan", seed=1, poses=200)
    picture = cairn.draw({"drifted": graph, "truth": truth}, "svg", width=400, height=300)
    assert picture.startswith(b"<?xml") and b'viewBox="0 0 300 225"' in picture  # points
    assert cairn.draw({"graph": graph}, "png").startswith(b"\x89PNG")
    with pytest.raises(cairn.Error, match="picture"):
        cairn.draw({"graph": graph}, "jpeg")


def drawn_numbers(picture):
    """Those of the paths of an SVG, in the order in which they are drawn [pt]."""
    paths = re.findall(rb' d="([^"]*)"', picture)
    return np.array([float(number) for path in paths for number in re.findall(rb"-?[0-9.]+", path)])


def ellipses_of(picture):
    """The corners (24, 2) of each closed path in the thin stroke of covariances [pt]."""
    thin = [path for path in re.findall(rb"<path [^>]*stroke-width:0\.7;[^>]*>", picture)]
    longest = max(thin, key=len)
    loops = re.search(rb' d="([^"]*)"', longest).group(1).split(b"M ")[1:]
    return np.array([[float(x) for x in re.findall(rb"-?[0-9.]+", loop)][:48] for loop in loops]).reshape(len(loops), 24, 2)


@pytest.mark.skipif("svg" not in cairn.components("picture"), reason="no plugin draws SVG")
@pytest.mark.parametrize("name, pose, motion", [
    (dict(generator="manhattan", poses=200), cairn.Pose2, cairn.Pose2(30, -10, 2)),
    (dict(generator="sphere", turns=3), cairn.Pose3, cairn.Pose3.exp([5, -30, 8, 0.4, -1, 0.3])),
])
def test_an_estimate_is_aligned_to_the_truth(name, pose, motion, tmp_path):
    graph, truth = cairn.generate(seed=1, **name)
    turned = graph.copy()
    turned.set_states(pose, [(motion * pose.from_state(row)).state for row in graph.states(pose)])
    expected = drawn_numbers(cairn.draw({"estimate": graph}, truth=truth))
    aligned = drawn_numbers(cairn.draw({"estimate": turned}, truth=truth))
    assert_allclose(aligned, expected, atol=0.02)
    truth.write(tmp_path / "truth.g2o")
    for name, each in [("plain", graph), ("turned", turned)]:
        each.write(tmp_path / "map.g2o")
        command = [os.environ["CAIRN_PROGRAM"], "plot", "map.g2o", "--truth", "truth.g2o", "-o", f"{name}.svg", "--quiet"]
        subprocess.run(command, cwd=tmp_path, check=True)
    assert_allclose(drawn_numbers((tmp_path / "turned.svg").read_bytes()), drawn_numbers((tmp_path / "plain.svg").read_bytes()), atol=0.02)
    apart = drawn_numbers(cairn.draw({"estimate": turned, "truth": truth}))
    assert len(apart) != len(expected) or np.abs(apart - expected).max() > 10


@pytest.mark.skipif("svg" not in cairn.components("picture"), reason="no plugin draws SVG")
def test_covariances_are_drawn_as_ellipses():
    graph, truth = cairn.generate("manhattan", seed=1, poses=60)
    cairn.optimize(graph)
    ids = graph.ids(cairn.Pose2)[1:]
    covariances = {"estimate": (ids, cairn.marginals(graph, ids))}
    three = ellipses_of(cairn.draw({"estimate": graph}, covariances=covariances))
    assert len(three) == len(ids)
    # Each has the shape of the covariance of the position in the world: R S R^T, y upwards. The picture has a scale of its own.
    headings = graph.states(cairn.Pose2)[1:, 2]
    scales = []
    for corners, heading, block in zip(three, headings, covariances["estimate"][1]):
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        world = turn @ block[:2, :2] @ turn.T
        deviation = (corners - corners.mean(0)) * [1, -1]
        scales.append(np.sqrt((deviation**2).sum(0) / (24 / 2 * 9 * np.diagonal(world))))  # of 24 corners at 3 sigma
    scales = np.array(scales)[20:]  # the first are smaller than the digits of the file
    assert_allclose(scales, np.median(scales), rtol=0.05)
    six = ellipses_of(cairn.draw({"estimate": graph}, covariances=covariances, ellipses=1))
    assert np.ptp(six[-1], axis=0).max() < np.ptp(three[-1], axis=0).max() / 2.5
    sphere, _ = cairn.generate("sphere", seed=1, turns=3)
    ids = sphere.ids(cairn.Pose3)[1:]
    assert len(ellipses_of(cairn.draw({"e": sphere}, covariances={"e": (ids, cairn.marginals(sphere, ids))}))) == len(ids)


@pytest.mark.skipif("svg" not in cairn.components("picture"), reason="no plugin draws SVG")
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
