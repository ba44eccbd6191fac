# SPDX-License-Identifier: BSD-3-Clause
import html
import importlib.util
import re

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


@pytest.mark.skipif("html" not in cairn.components("picture"), reason="no plugin makes pages")
def test_a_notebook_shows_the_page():
    graph, _ = cairn.generate("manhattan", seed=1, poses=50)
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', graph._repr_html_()).group(1))
    assert page.lstrip().lower().startswith("<!doctype html") and "cairn-data" in page
    assert cairn.Graph()._repr_html_() is None
