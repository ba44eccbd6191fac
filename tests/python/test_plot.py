# SPDX-License-Identifier: BSD-3-Clause
"""What cairn.plot puts onto axes, and the numbers that it is put there for."""
import base64
import io
import json
import os
import subprocess
import sys
import zlib

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import cairn

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")
from cairn.plot import _axes, _bench, _curves, _exploration, _numbers, _page, _sparsity, _theme, _trajectory  # noqa: E402
from matplotlib import pyplot  # noqa: E402
from matplotlib.colors import to_hex  # noqa: E402

LIGHT, DARK = _theme.THEMES["light"], _theme.THEMES["dark"]
has_plots = pytest.mark.skipif("json" not in cairn.components("picture"), reason="the plugin plot is missing")


@pytest.fixture(autouse=True)
def no_figures_left():
    yield
    pyplot.close("all")


def packed(kind, numbers, how="base64", **more):
    data = np.asarray(numbers, kind).tobytes()
    name = {"<f4": "f32", "<i4": "i32", "u1": "u8", "<u2": "u16"}[kind]
    return {"type": name, "count": len(numbers), how: base64.b64encode(zlib.compress(data) if how == "deflate" else data).decode(), **more}


# Axes.


def ticks(low, high, logarithmic, count, whole=False):
    found = _axes.locator(low, high, logarithmic, count, whole).tick_values(low, high)
    return [tick for tick in found if low * (1 - 1e-9) <= tick <= high * (1 + 1e-9)]


def test_a_logarithmic_axis_has_ticks_below_its_first_power_of_ten():
    assert_allclose(ticks(0.12, 6.0, True, 6), [0.2, 0.5, 1, 2, 5])  # seconds of solvers, of which the fastest take less than one


@pytest.mark.parametrize("low", [1e-7, 0.003, 0.12, 0.99, 1.0, 7.0])
@pytest.mark.parametrize("factor", [1.2, 8.0, 20.0, 3e4, 1e9])
def test_an_axis_has_at_least_two_ticks_and_not_too_many(low, factor):
    assert 2 <= len(ticks(low, factor * low, True, 5)) <= 12


def test_an_axis_of_iterations_has_whole_numbers_only():
    assert_array_equal(ticks(*_axes.range_of(np.arange(3)), False, 6, whole=True), [0, 1, 2])


@pytest.mark.parametrize("high", [3e-4, 2e-3, 0.7, 40.0, 2e6])
def test_the_ticks_of_an_axis_read_apart(high):
    texts = [_axes.tick_text(tick) for tick in ticks(*_axes.range_of(np.array([0, high])), False, 6)]
    assert len(texts) >= 3 and len(set(texts)) == len(texts)


def test_numbers_are_short():
    assert [_axes.tick_text(x) for x in (0, 1200, 0.05, 1e-7, -2.5e6, 0.1 + 0.2)] == ["0", "1200", "0.05", "1e-7", "-2.5e6", "0.3"]


def test_a_range_leaves_out_what_cannot_be_shown():
    assert _axes.range_of(np.array([np.nan, np.inf])) == (0, 1)
    assert _axes.range_of(np.array([-1, 0.0]), True) == (1, 10)
    assert_allclose(_axes.range_of(np.array([0, 100, np.inf])), (-3, 103))
    low, high = _axes.range_of(np.array([-5, 1, 100.0]), True)
    assert 0.8 < low < 1 and 100 < high < 125
    assert _axes.range_of(np.array([4.0, 4.0])) == (3.5, 4.5)


def test_edges_that_go_on_are_one_line():
    points = np.array([[0, 0], [1, 0], [1, 1], [5, 5], [np.nan, 0]])
    line = _axes.chain(np.array([0, 1, 3, 0, 2, 3]), np.array([1, 2, 2, 4, -1, 1]), points)
    gap = [np.nan, np.nan]
    assert_array_equal(line, [[0, 0], [1, 0], [1, 1], gap, [5, 5], [1, 1], gap, [5, 5], [1, 0]])
    assert len(_axes.chain(np.array([0]), np.array([-1]), points)) == 0


def test_both_axes_of_a_plane_have_the_same_scale():
    ax = pyplot.figure().add_subplot()
    _axes.equal_limits(ax, np.array([[0, 0], [10, 2]]), 500, 200)
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert_allclose((right - left) / 500, (top - bottom) / 200)
    assert left < 0 and right > 10 and (bottom + top) / 2 == pytest.approx(1)


# Ellipses.


@pytest.mark.parametrize("correlation", [0.0, 0.6, -0.99])
def test_the_corners_of_an_ellipse_are_as_far_as_asked_for(correlation):
    covariance = np.array([[4.0, 6 * correlation], [6 * correlation, 9.0]])
    corners = _axes.ellipse(covariance, 3.0)
    assert_array_equal(corners[0], corners[-1])
    assert_allclose(np.einsum("ni,ij,nj->n", corners, np.linalg.inv(covariance), corners), 9)
    assert np.abs(corners[:, 0]).max() == pytest.approx(6, abs=0.1)  # three standard deviations of x


def test_an_ellipse_of_one_direction_is_a_line_and_of_no_covariance_nothing():
    line = _axes.ellipse(np.diag([0.0, 4.0]), 1.0)
    assert_array_equal(line[:, 0], 0)
    assert np.abs(line[:, 1]).max() == pytest.approx(2)
    for wrong in (np.diag([-1.0, 1.0]), np.array([[np.nan, 0], [0, 1]]), np.array([[1, np.inf], [np.inf, 1]])):
        assert len(_axes.ellipse(wrong, 1.0)) == 0


# Numbers.


def test_packed_numbers_are_read():
    assert_array_equal(_numbers.array([1, None, 2.5]), [1, np.nan, 2.5])
    assert_array_equal(_numbers.array(packed("<f4", [1.5, -2])), [1.5, -2])
    assert_array_equal(_numbers.array(packed("<i4", [7, -1], "deflate")), [7, -1])
    steps = packed("<u2", [0, 65534, 32767, 65535], min=[10, -1], max=[20, 1])
    assert_allclose(_numbers.array(steps), [10, 1, 15, np.nan], atol=1e-3)
    for wrong in (dict(packed("u1", [1, 2]), count=3), dict(packed("u1", [1, 2], "deflate"), count=1), dict(packed("u1", [1]), base64="!"),
                  dict(packed("u1", [1]), count=10**12)):
        with pytest.raises(ValueError):
            _numbers.array(wrong)


# Graphs.


def scene(**more):
    """Three poses and a landmark, with a loop closure."""
    positions = np.array([[0, 0], [1, 0], [1, 1], [3, 2.0]])
    estimate = _numbers.Estimate("best", "estimate", positions, np.array([0.1, 0.2, 5.0, 1.0]), np.array([1]), np.array([np.diag([0.04, 0.01])]))
    guess = _numbers.Estimate("start", "initial", positions + [[0, 0], [0.1, 0], [0.2, 0], [0, 0]])
    edges = dict(a=np.array([0, 1, 2, 1]), b=np.array([1, 2, 0, 3]), edge_class=np.array([0, 0, 1, 2]))
    return _numbers.Scene(**{**dict(name="town", dimension=2, **edges, is_pose=np.array([True, True, True, False]),
                                    estimates=[estimate, guess], runs=[]), **more})


def drawn(plot):
    """The artists of a plot on a page, by id."""
    page = _page.Page(600, 400, LIGHT)
    ax = page.add(page.panels(1)[0], plot)
    return {artist.get_gid(): artist for artist in ax.get_children() if artist.get_gid()}, ax, page


def data(line):
    return np.array(line.get_data()).T


def test_a_graph_is_drawn_where_its_variables_are():
    plot = _trajectory.plot_of(scene(), LIGHT, _trajectory.Options(poses=True, ellipses=2))
    parts, ax, _ = drawn(plot)
    assert set(parts) == {"initial", "estimate", "loop-closures", "landmark-edges", "landmarks", "poses", "covariances"}
    assert_array_equal(data(parts["estimate"]), [[0, 0], [1, 0], [1, 1]])
    assert_allclose(data(parts["initial"]), [[0, 0], [1.1, 0], [1.2, 1]])
    assert_array_equal(data(parts["loop-closures"]), [[1, 1], [0, 0]])
    assert_array_equal(data(parts["landmark-edges"]), [[1, 0], [3, 2]])
    assert_array_equal(data(parts["landmarks"]), [[3, 2]])
    assert_array_equal(data(parts["poses"]), [[0, 0], [1, 0], [1, 1]])
    outline = data(parts["covariances"])[:-1]
    assert_allclose((outline.max(0) - outline.min(0)) / 2, [0.4, 0.2], rtol=0.01)
    assert_allclose(outline.mean(0), [1, 0], atol=0.05)
    # Colours, dashes and order are those of docs/report.md.
    assert to_hex(parts["estimate"].get_color()) == "#0072b2" and parts["estimate"].get_linestyle() == "-"
    assert to_hex(parts["initial"].get_color()) == "#8a8f98" and parts["initial"].is_dashed()
    assert parts["initial"].get_zorder() < parts["estimate"].get_zorder()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")
    assert [name for name, _ in plot.legend] == ["best", "start", "loop closure", "landmark", "pose", "covariance, 2 σ"]


def test_colours_of_residuals_go_from_the_least_to_the_worst():
    parts, _, _ = drawn(_trajectory.plot_of(scene(), LIGHT, _trajectory.Options(by_residual=True)))
    assert_array_equal(data(parts["largest-residual"]), [[1, 1], [0, 0]])
    assert to_hex(parts["largest-residual"].get_color()) == "#5c0a12"
    others = [part for name, part in parts.items() if name.startswith("residuals")]
    assert len(others) == 3 and "estimate" not in parts and "loop-closures" not in parts
    assert all(part.get_zorder() < parts["largest-residual"].get_zorder() for part in others)
    assert all(part.get_linewidth() < parts["largest-residual"].get_linewidth() for part in others)
    assert to_hex(DARK.residual(0)) == "#3a424d" and to_hex(LIGHT.residual(0.25)) == "#f0c987"


def test_the_truth_lies_over_the_estimate_and_peers_have_colours_of_their_own():
    positions = scene().estimates[0].positions
    many = [_numbers.Estimate(name, role, positions) for name, role in
            [("truth", "truth"), ("best", "estimate"), ("one", "peer"), ("two", "peer"), ("start", "initial")]]
    layers = _trajectory.layers_of(scene(estimates=many), LIGHT)
    assert [layer.estimate.name for layer in layers] == ["start", "one", "two", "best", "truth"]
    assert _trajectory.main_layer(layers).estimate.name == "best"
    assert [layer.stroke.colour for layer in layers[1:3]] == ["#d55e00", "#009e73"]


def test_a_guess_that_is_far_out_is_cut_off():
    far = scene()
    far.estimates[1].positions *= 100
    bounds = _trajectory.visible_bounds(far, _trajectory.layers_of(far, LIGHT))
    assert_array_equal(bounds, [[0, 0], [3, 2]])
    far.estimates[1].positions /= 50
    assert _trajectory.visible_bounds(far, _trajectory.layers_of(far, LIGHT))[1, 0] == 6


def test_a_graph_in_space_is_projected_with_a_scale():
    positions = np.array([[0, 0, 0], [10, 0, 0], [0, 0, 10.0]])
    covariance = np.array([[4, 1, -0.5], [1, 3, 0.25], [-0.5, 0.25, 2]])
    estimate = _numbers.Estimate("best", "estimate", positions, None, np.array([0]), np.array([covariance]))
    space = scene(dimension=3, a=np.array([0, 1]), b=np.array([1, 2]), edge_class=np.array([0, 0]), is_pose=np.ones(3, bool), estimates=[estimate])
    parts, ax, _ = drawn(_trajectory.plot_of(space, LIGHT, _trajectory.Options(ellipses=1)))
    line = data(parts["estimate"])
    assert_allclose(line[2], [0, 10 * np.cos(_trajectory.ELEVATION)])
    outline = data(parts["covariances"])[:-1]
    expected = _trajectory.PROJECTION @ covariance @ _trajectory.PROJECTION.T
    assert_allclose(np.einsum("ni,ij,nj->n", outline, np.linalg.inv(expected), outline), 1)
    [length] = [text.get_text() for text in ax.texts]
    x = parts["scale"].get_xdata()
    low, high = ax.get_xlim()
    assert (x[1] - x[0]) * (high - low) == pytest.approx(float(length.removesuffix(" m")))


def test_what_cannot_be_drawn_says_what_would_work():
    no_covariances = scene()
    no_covariances.estimates[0].covariances = no_covariances.estimates[0].covariances[:0]
    nowhere = scene()
    for estimate in nowhere.estimates:
        estimate.positions[:] = np.nan
    for call, message, code in [
        (lambda: _trajectory.plot_of(no_covariances, LIGHT, _trajectory.Options(ellipses=3)), "--covariance blocks", 3),
        (lambda: _trajectory.plot_of(nowhere, LIGHT, _trajectory.Options()), "town: none of its variables has a position", 3),
        (lambda: _trajectory.plots_of([], LIGHT, _trajectory.Options()), "no graph to draw", 3),
        (lambda: _curves.columns([], LIGHT), "--steps", 3),
        (lambda: _curves.columns([_curves.Table("t", {"a": np.zeros(2), "b": np.ones(2)})], LIGHT, x="c"), "t has no column 'c'; it has a, b", 2),
        (lambda: _curves.columns([_curves.Table("t", {"a": np.zeros(2), "b": np.ones(2)})], LIGHT, patterns=["c*"]), "matches 'c\\*'", 2),
        (lambda: _curves.columns([_curves.Table("t", {"a": np.zeros(2), "b": np.ones(2)})], LIGHT, logarithmic="x"), "no point can be drawn", 3),
        (lambda: _bench.read_bench(None), "cairn bench --json", 3),
        (lambda: _bench.read_bench({"graphs": []}), "no graphs", 3),
    ]:
        with pytest.raises(_numbers.PlotError, match=message) as caught:
            call()
        assert caught.value.code == code


# Curves.


def test_columns_are_named_after_what_tells_them_apart():
    first = _curves.Table("frontier", {"distance": np.array([0, 1, 2.0]), "error a": np.array([3, np.nan, 1]), "text": np.full(3, np.nan)})
    second = _curves.Table("random", {"distance": np.array([0, 1.0]), "error b": np.array([5, 4.0]), "time": np.array([1, 2.0])})
    plot, = _curves.columns([first], LIGHT)
    assert (plot.title, [name for name, _ in plot.legend]) == ("error a against distance", ["error a"])
    plot, = _curves.columns([first, second], LIGHT, patterns=["error *"])
    assert (plot.title, [name for name, _ in plot.legend]) == ("error against distance", ["frontier", "random"])
    every, times = _curves.columns([first, second], LIGHT, patterns=["*", "t*"])
    assert [name for name, _ in every.legend] == ["frontier: error a", "random: error b", "random: time"]
    assert times.title == "time against distance"
    parts, ax, _ = drawn(_curves.columns([first], LIGHT, x_max=1.5, logarithmic="y")[0])
    assert_array_equal(data(parts["error-a"]), [[0, 3], [np.nan, np.nan]])
    assert (ax.get_xscale(), ax.get_yscale(), ax.get_ylabel()) == ("linear", "log", "error a")


def test_curves_of_runs_are_after_iterations_or_time():
    curve = _curves.curve("lm", 100.0, [{"chi2": 10.0, "seconds": 0.5}, {"chi2": None, "seconds": 0.25}, {"chi2": 1.0, "seconds": 0.25}])
    parts, ax, _ = drawn(_curves.convergence("town", [curve], False, LIGHT))
    assert_array_equal(data(parts["lm"]), [[0, 100], [1, 10], [np.nan, np.nan], [3, 1]])
    assert ax.get_yscale() == "log" and parts["lm"].get_marker() == "o"
    parts, ax, _ = drawn(_curves.convergence("town", [curve], True, LIGHT))
    assert_array_equal(data(parts["lm"])[[0, 1, 3]], [[0, 100], [0.5, 10], [1, 1]])
    assert ax.get_xlabel() == "time [s]"
    parts, _, _ = drawn(_curves.steps("town", [curve], LIGHT))
    assert_array_equal(data(parts["lm"]), [[1, 500], [2, 250], [3, 250]])
    long = _curves.curve("long", 1.0, [{"chi2": 1.0, "seconds": 1.0}] * 200)
    assert drawn(_curves.steps("", [long], LIGHT))[0]["long"].get_marker() == "None"


def bench_report(memory=(2**20, 2**21)):
    def configuration(label, median, bytes_used):
        seconds = {"median": median, "min": median / 2, "max": median * 2} if median else None
        return {"label": label, "seconds": seconds, "peak_memory_bytes": bytes_used, "chi2": {"initial": 5.0},
                "history": [{"chi2": 1.0, "seconds": 0.1}]}

    return {"graphs": [{"graph": {"name": name, "variables": size}, "configurations": [
        configuration("a", median, bytes_used), configuration("b", 0, None)]}
        for name, size, median, bytes_used in [("large", 1000, 2.0, memory[1]), ("small", 10, 0.01, memory[0])]]}


def test_bars_are_as_long_as_the_medians():
    large, small = _bench.bars(_bench.read_bench(bench_report()), LIGHT)
    parts, ax, page = drawn(small)
    assert parts["bar"].get_width() == 0.01 and [label.get_text() for label in ax.get_yticklabels()] == ["a", "b"]
    assert {text.get_text() for text in ax.texts} == {"10 ms", "did not run"}
    whisker = [line for line in ax.get_lines() if line.get_marker() == "|"]
    assert_array_equal(whisker[0].get_xdata(), [0.005, 0.02])
    time = next(text for text in ax.texts if text.get_text() == "10 ms").get_window_extent()
    assert time.x1 <= page.width and ax.get_xlim()[1] > 0.02
    assert large.title == "large"


def test_time_and_memory_are_over_size():
    plots = _bench.scaling(_bench.read_bench(bench_report()), LIGHT)
    seconds, memory = (drawn(plot)[0]["a"] for plot in plots)
    assert_array_equal(data(seconds), [[10, 0.01], [1000, 2]])
    assert_array_equal(data(memory), [[10, 1], [1000, 2]])
    assert drawn(plots[0])[1].get_xscale() == drawn(plots[0])[1].get_yscale() == "log"
    assert len(_bench.scaling(_bench.read_bench(bench_report((None, None))), LIGHT)) == 1


def test_cells_side_by_side_are_one_rectangle():
    assert_array_equal(_sparsity.runs(np.array([[1, 1, 0, 1], [0, 0, 0, 0], [1, 1, 1, 1]]) != 0), [[0, 0, 2], [0, 3, 4], [2, 0, 4]])
    pattern = {"cells": 2, "marked": packed("u1", [1, 0, 1, 1], "deflate"), "blocks": 3, "nonzeros": 21}
    h, l = _sparsity.plots_of({"name": "town", "ordering": "amd", "H": pattern, "L": pattern}, LIGHT)
    assert (h.title, l.title, h.subtitle) == ("town: H", "L, ordering amd", "3 blocks, 21 nonzeros in the lower triangle")
    parts, ax, _ = drawn(h)
    path = parts["blocks"].get_path()
    assert path.vertices.max(0).tolist() == [2, 2] and len(path.vertices) == 2 * 5
    assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the first row is above


# Explorations: a robot that stands, decides, drives and decides again, as docs/recording.md has it.


def recording():
    scan = {"first_angle": -np.pi / 2, "angle_step": np.pi / 2, "max_range": 8, "ranges": [2.0, 8.0, 1.0]}
    return {"name": "run", "header": {"robot": {"radius": 0.25}}, "lines": [
        {"step": 0, "decision": 0, "estimate": [1, 2, 0], "covariance": [0.04, 0.01, 0.09], "scan": scan, "poses": [[0, 1, 2, 0]],
         "map": {"resolution": 0.5, "origin": [10, 20], "yaw": 0, "x": -1, "y": 2, "width": 2, "height": 2,
                 "cells": packed("u1", [0, 100, 255, 40], "deflate")}},
        {"decision": 1, "kind": "drive", "candidates": [{"value": 3, "points": [[1, 2], [4, 6]]}, {"value": 2}], "chosen": 0},
        {"step": 1, "decision": 1, "estimate": [4, 6, np.pi / 2], "covariance": None, "scan": scan,
         "poses": [[0, 1.5, 2, 0], [7, 4, 6, 1], [8, 5, 6, 1]], "edges": [[3, 0, 7, 0], [4, 7, 8, 1]],
         "map": {"x": 0, "y": 1, "width": 2, "height": 2, "cells": packed("u1", [7, 254, 254, 8], "deflate")}},
        {"decision": 2, "kind": "drive", "candidates": [], "tree": {
            "count": 3, "positions": [4, 6, 5, 6, 5, 8], "parents": packed("<i4", [-1, 0, 1], "deflate"), "values": [0, -2, 1]}},
        {"end": "limit", "poses": [[7, 4.5, 6, 1]], "removed_poses": [8], "removed_edges": [4]}]}


def test_a_decision_has_what_was_known_then():
    state = _exploration.state_of(recording(), 1)
    assert (state.name, state.radius, state.robot, state.covariance[0, 1]) == ("run", 0.25, (1, 2), 0.01)
    assert_array_equal(state.map.cells, [[0, 100], [255, 40]])
    # Cell (-1, 2) of half a metre from (10, 20).
    assert_allclose(state.map.to_world().transform([0, 0]), [9.5, 21])
    assert_allclose(state.scan, [[1, 0], [1, 3]], atol=1e-12)  # to the right 2 m, ahead nothing, to the left 1 m
    assert state.decision.chosen == 0 and len(state.decision.paths) == 2
    assert_array_equal(state.decision.paths[0][1], [[1, 2], [4, 6]])


def test_what_has_changed_is_put_together():
    state = _exploration.state_of(recording(), 2)
    # The box has grown by a column to the right and a row below; 254 has not changed.
    assert_allclose(state.map.to_world().transform([0, 0]), [9.5, 20.5])
    assert_array_equal(state.map.cells, [[255, 7, 255], [0, 100, 8], [255, 40, 255]])
    assert state.poses[0] == (1.5, 2) and state.edges[4] == (7, 8, 1)
    assert not state.covariance.any()
    assert_allclose(state.scan[0], [6, 6])  # its right, with its heading turned to the left
    assert state.decision.chosen is None
    assert_array_equal(state.decision.parents, [-1, 0, 1])
    end = _exploration.state_of(recording())
    assert end.decision is None and end.poses == {0: (1.5, 2), 7: (4.5, 6)} and list(end.edges) == [3]


def test_a_recording_that_cannot_be_drawn_is_refused():
    for damage, wanted, message in [
        (lambda run: None, 3, "run: there is no decision 3; the last one is 2"),
        (lambda run: run["lines"].clear(), None, "run: the recording has no map to draw"),
        (lambda run: run["lines"].clear(), 1, "run: the recording has no decisions"),
        (lambda run: run["lines"][0]["map"].update(resolution=1e-300), 1, "run: the recording is damaged"),
        (lambda run: run["lines"][0]["map"].update(origin=[1e20, 20]), 1, "damaged"),
        (lambda run: run["lines"][0]["map"].update(origin=[]), 1, "damaged"),
        (lambda run: run["lines"][0]["map"].update(yaw=None), 1, "damaged"),
        (lambda run: run["lines"][0].update(poses=[3]), 1, "damaged"),
        (lambda run: run["lines"][2]["map"].update(x=10**8), 2, "damaged"),
        (lambda run: run["lines"][0]["map"].update(width=1e-300), 1, "no map to draw"),
    ]:
        run = recording()
        damage(run)
        with pytest.raises(_numbers.PlotError, match=message):
            _exploration.state_of(run, wanted)
    # A part that cannot be is left out; a robot too far off has not come there.
    run = recording()
    run["lines"][2]["map"]["x"] = 0.5
    run["lines"][2]["estimate"][0] = 4e20
    state = _exploration.state_of(run, 2)
    assert state.map.cells.shape == (2, 2) and state.robot == (1, 2)


def test_damaged_text_is_an_error_at_most():
    whole, random, read = json.dumps(recording()), np.random.default_rng(5), 0
    for k in range(3000):
        damaged = list(whole)
        for _ in range(3):
            damaged[random.integers(len(damaged))] = random.choice(list("0123456789,[]-\"eu"))
        try:
            value = json.loads("".join(damaged))
        except ValueError:
            continue
        try:
            _exploration.known_bounds(_exploration.state_of(value, [1, 2, None][k % 3]))
            read += 1
        except _numbers.PlotError:  # as it should
            pass
    assert read > 100


def test_a_map_is_drawn_with_the_graph_and_what_was_to_choose_from():
    plot = _exploration.plot_of(_exploration.state_of(recording(), 1), LIGHT)
    parts, ax, _ = drawn(plot)
    assert [name for name, _ in plot.legend] == ["trajectory", "scan", "robot, 3 σ", "candidate of 2", "of 3", "chosen"]
    assert_array_equal(data(parts["chosen"]), [[1, 2], [4, 6]])
    assert_allclose(np.ptp(data(parts["robot"]), axis=0), [0.5, 0.5])
    assert np.ptp(data(parts["covariance"]), axis=0)[0] == pytest.approx(2 * 3 * 0.2)
    image = parts["map"].get_array()
    colours = {name: tuple(np.rint(255 * np.array(matplotlib.colors.to_rgb(colour)))) for name, colour in
               [("free", LIGHT.paper), ("occupied", LIGHT.ink), ("unknown", LIGHT.grid)]}
    assert [tuple(image[0, 0]), tuple(image[0, 1]), tuple(image[1, 0])] == [colours["free"], colours["occupied"], colours["unknown"]]
    later = drawn(_exploration.plot_of(_exploration.state_of(recording(), 2), LIGHT))[0]
    assert_array_equal(data(later["loop-closures"]), [[4, 6], [5, 6]])
    assert_array_equal(data(later["trajectory"]), [[1.5, 2], [4, 6]])
    # The better branch of the tree is drawn over the other, in the colour that stands out most.
    assert_array_equal(data(later["choices-2"]), [[4, 6], [5, 6]])
    assert to_hex(later["choices-2"].get_color()) == "#5c0a12" and later["choices"].get_zorder() < later["choices-2"].get_zorder()


# Pages.


def test_a_legend_has_as_many_rows_as_it_takes_and_long_names_are_cut():
    page = _page.Page(400, 300, LIGHT)
    plot = _axes.Plot("title", lambda ax, names: None, legend=[(f"series {k}", _theme.Stroke("red")) for k in range(9)])
    rest = page.heading(_page.Box(10, 10, 380, 280), plot)
    texts = page.figure.texts
    assert len({text.get_position()[1] for text in texts}) > 2  # title, and more than one row
    for text in texts:
        extent = text.get_window_extent(page.canvas.get_renderer())
        assert extent.x1 <= 390 and 300 - extent.y0 <= rest.y
    page.text(0, 20, "x" * 500, "red", 100)
    assert page.figure.texts[-1].get_text().endswith("x…") and page.text_width(page.figure.texts[-1].get_text()) <= 100


def test_panels_fill_the_page_and_do_not_overlap():
    page = _page.Page(900, 600, LIGHT)
    boxes = page.panels(5)
    assert len({box.x for box in boxes}) == 3 and len({box.y for box in boxes}) == 2
    assert max(box.x + box.width for box in boxes) == pytest.approx(900 - 16)
    assert [box.y for box in page.panels(2, 1)] == [16, pytest.approx(308)]


@has_plots
def test_a_picture_does_not_depend_on_the_settings_of_the_user():
    graph, _ = cairn.generate("ring", seed=1, poses=20)
    plain = cairn.draw({"$g_1$": graph}, "svg")
    with matplotlib.rc_context({"font.size": 30, "lines.linewidth": 9, "text.usetex": True, "savefig.bbox": "tight", "axes.grid": False}):
        assert cairn.draw({"$g_1$": graph}, "svg") == plain
    assert b"<!-- $g_1$ -->" in plain
    assert b"DejaVuSans" in plain
    picture = cairn.draw({"g": graph}, "png", width=331, height=207)
    assert pyplot.imread(io.BytesIO(picture)).shape[:2] == (207, 331)


@has_plots
def test_the_program_draws_the_numbers_that_it_writes():
    graph, _ = cairn.generate("ring", seed=1, poses=20)
    numbers = cairn.draw({"g": graph}, "json")
    command = [sys.executable, "-m", "cairn.plot"]
    ended = subprocess.run([*command, "svg"], input=numbers, capture_output=True, check=True)
    assert ended.stdout == cairn.draw({"g": graph}, "svg") and not ended.stderr
    wrong = subprocess.run([*command, "gif"], input=numbers, capture_output=True)
    assert wrong.returncode == 2 and b"python3 -m cairn.plot svg" in wrong.stderr
    changed = json.loads(numbers)
    changed["options"]["what"] = "map"
    missing = subprocess.run([*command, "svg"], input=json.dumps(changed).encode(), capture_output=True)
    assert missing.returncode == 3 and missing.stderr.startswith(b"no map to draw") and not missing.stdout


# In notebooks.


@has_plots
def test_plots_are_drawn_onto_axes_that_are_given():
    graph, truth = cairn.generate("manhattan", seed=1, poses=100)
    best = graph.copy()
    summary = cairn.optimize(best)
    figure, axes = pyplot.subplots(2, 2)
    assert cairn.plot.trajectory({"start": graph, "best": best}, axes[0, 0], truth=truth, poses=True) is axes[0, 0]
    assert [text.get_text() for text in axes[0, 0].get_legend().get_texts()][:3] == ["ground truth", "best", "start"]
    positions = best.states(cairn.Pose2)[:, :2]
    poses = next(line for line in axes[0, 0].get_lines() if line.get_marker() == "s")
    aligned = data(poses)
    assert_allclose(np.linalg.norm(aligned[1:] - aligned[:-1], axis=1), np.linalg.norm(positions[1:] - positions[:-1], axis=1), atol=1e-5)
    assert cairn.plot.convergence({"lm": summary}, axes[0, 1], x="time") is axes[0, 1]
    [line] = axes[0, 1].get_lines()
    assert_allclose(line.get_ydata(), [summary.initial_chi2, *(each.chi2 for each in summary.iterations)])
    assert_allclose(line.get_xdata()[-1], sum(each.seconds for each in summary.iterations))
    assert cairn.plot.steps({"lm": summary}, axes[1, 0]) is axes[1, 0]
    assert cairn.plot.columns({"t": {"a": [1, 2], "b": [3, 4]}}, axes[1, 1], log="xy") is axes[1, 1]
    assert axes[1, 1].get_title() == "b against a"
    h, l = cairn.plot.sparsity(graph)
    assert h.get_title().startswith("graph: H") and h.figure is l.figure is not figure
    assert cairn.plot.trajectory(graph).figure not in (figure, h.figure)
    figure.savefig(io.BytesIO())


@has_plots
def test_files_of_runs_are_drawn(tmp_path):
    report = tmp_path / "bench.json"
    report.write_text(json.dumps(bench_report()))
    assert cairn.plot.bars(report, graph=1).get_title() == "small"
    assert cairn.plot.scaling(bench_report(), memory=True).get_title() == "Peak memory"
    run = tmp_path / "run.json"
    run.write_text(json.dumps({"chi2": {"initial": 4.0}, "iterations": [{"chi2": 2.0, "seconds": 0.1}]}))
    assert_array_equal(cairn.plot.convergence({"file": run}).get_lines()[0].get_ydata(), [4, 2])
    lines = tmp_path / "robot.jsonl"
    run = recording()
    lines.write_text("".join(json.dumps(line) + "\n" for line in [run["header"], *run["lines"]]))
    ax = cairn.plot.exploration(lines, decision=1)
    assert ax.get_title() == str(lines) and len(ax.get_images()) == 1
    assert len(cairn.plot.exploration([run["header"], *run["lines"]]).get_images()) == 1


@has_plots
def test_errors_are_those_of_cairn():
    graph, _ = cairn.generate("ring", seed=1, poses=20)
    other, _ = cairn.generate("sphere", seed=1, turns=2)
    for call, message in [
        (lambda: cairn.plot.trajectory(graph, theme="grey"), "theme is 'grey', expected light or dark"),
        (lambda: cairn.plot.trajectory(graph, colour="red"), "colour is 'red'"),
        (lambda: cairn.plot.trajectory(graph, ellipses=3), "no covariances to draw"),
        (lambda: cairn.plot.trajectory({"a": graph, "b": other}), "one at a time: a, b"),
        (lambda: cairn.plot.convergence({}), "there is no run to draw"),
        (lambda: cairn.plot.convergence({"a": None}, x="steps"), "x is 'steps'"),
        (lambda: cairn.plot.bars(bench_report(), graph=2), "there is no graph 2; expected 0 to 1"),
        (lambda: cairn.plot.scaling(bench_report((None, None)), memory=True), "was not measured"),
        (lambda: cairn.plot.sparsity(graph, linear_solver="eigen"), "block_cholesky does"),
        (lambda: cairn.plot.exploration([]), "no map to draw"),
        (lambda: cairn.draw({"a": graph}, "svg", what="bars"), "cairn bench --json"),
        (lambda: cairn.draw({"a": graph}, "svg", what="pie"), "pie"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            call()


def test_matplotlib_is_imported_by_the_first_plot_alone():
    code = "import sys, cairn; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env=dict(os.environ)).returncode == 0
