# SPDX-License-Identifier: BSD-3-Clause
"""Sparsification, against the program and dense algebra."""
import json
import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import cairn
import dense
from cairn import Pose2
from graphs import from_dense


def program(folder, graph, *arguments):
    graph.write(folder / "in.g2o")
    command = [os.environ["CAIRN_PROGRAM"], "sparsify", "in.g2o", "--json", "run.json", "--quiet", "-o", "out.g2o", *arguments]
    subprocess.run(command, cwd=folder, check=True)
    return json.loads((folder / "run.json").read_text()), cairn.read(folder / "out.g2o")


def number(value):
    return np.nan if value is None else value


@pytest.mark.parametrize(
    "arguments, options",
    [
        ([], {}),
        (["--keep-every", "3", "--topology", "clt"], dict(keep_every=3, topology="clt")),
        (["--keep-every", "4", "--scheme", "runs", "--population", "tree:1.5"], dict(keep_every=4, scheme="runs", population="tree:1.5")),
        (["--keep-every", "3", "--online", "20"], dict(keep_every=3, online=20)),
        (["--select", "least_loss:part=0.3", "--no-kld"], dict(select="least_loss:part=0.3", measure=False)),
    ],
)
def test_it_does_what_the_program_does(tmp_path, arguments, options):
    report, out = program(tmp_path, cairn.generate("manhattan", seed=3, poses=200)[0], *arguments)
    result = cairn.sparsify(cairn.read(tmp_path / "in.g2o"), **options)
    assert (result.initial_chi2, result.chi2) == (report["chi2"]["before"], report["chi2"]["after"])
    for name in ["kld", "rmse", "rmse_aligned", "conservative_margin"]:
        assert_array_equal(getattr(result, name), number(report[name]), name)
    assert (result.status, result.problems) == (report["status"], report["problems"]["count"])
    assert result.graph.variable_count == report["poses"]["kept"] == 200 - len(result.removed)
    assert_array_equal(result.graph.states(Pose2), out.states(Pose2))
    assert not set(result.removed) & set(result.graph.ids()) and result.refused == []


@pytest.mark.parametrize("selection, options", [("greedy_gain:part=0.25", {}), ("mac", dict(part=0.5))])
def test_loop_closures_leave_as_in_the_program(tmp_path, selection, options):
    name = cairn.spec(selection, **options)
    report, out = program(tmp_path, cairn.generate("manhattan", seed=3, poses=300)[0], "--edges", name)
    result = cairn.sparsify_edges(cairn.read(tmp_path / "in.g2o"), selection, **options)
    assert result.kld == report["kld"] and result.chi2 == report["chi2"]["after"]
    assert result.graph.factor_count == report["factors"]["out"] < report["factors"]["in"]
    for weight in ["rotation", "translation"]:
        for key, value in report["connectivity"][weight].items():
            assert_array_equal(result.connectivity[weight][key], number(value))
    assert_array_equal(result.graph.states(Pose2), out.states(Pose2))
    assert len(result.removed) == 0


def test_the_divergence_is_that_of_dense_gaussians():
    walk = dense.loop()
    walk.optimize()
    graph = from_dense(walk)
    before = graph.states(Pose2)
    result = cairn.sparsify(graph, keep_every=3, initial=None)
    assert_array_equal(graph.states(Pose2), before)  # it works on a copy
    kept = [int(k) for k in result.graph.ids() if k != 0]
    ids = np.array([[a, b] for a in kept for b in kept])

    def joint(graph):
        blocks = cairn.cross_covariances(graph, ids).reshape(len(kept), len(kept), 3, 3)
        return blocks.transpose(0, 2, 1, 3).reshape(3 * len(kept), -1)

    # Both at the states of the original graph.
    sparse = result.graph.copy()
    minimum = sparse.states(Pose2)
    for k in kept:
        sparse.set_states(Pose2, [walk.poses[k]], ids=[k])
    P, Q = joint(graph), joint(sparse)
    information = np.linalg.inv(Q)
    covariance = 0.5 * (np.trace(information @ P) - len(P) + np.linalg.slogdet(Q)[1] - np.linalg.slogdet(P)[1])
    moved = np.concatenate([Pose2(*walk.poses[k]).local(Pose2(*row)) for k, row in zip(result.graph.ids(), minimum) if k != 0])
    assert_allclose(result.kld, covariance + 0.5 * moved @ information @ moved, rtol=1e-4)
    assert_array_equal(joint(graph), joint(from_dense(walk)))
    position = minimum[:, :2] - walk.poses[result.graph.ids(), :2]
    assert_allclose(result.rmse, np.sqrt((position**2).sum(1).mean()), rtol=1e-6, atol=1e-9)


def test_wrong_names_and_options_say_what_would_work():
    graph = cairn.generate("manhattan", seed=3, poses=50)[0]
    for options, message in [
        (dict(keep_every=3, select="oldest"), "give one"),
        (dict(select="oldst"), "did you mean 'oldest'"),
        (dict(topolgy="clt"), "topology"),
        (dict(nodes="edges"), "landmarks"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            cairn.sparsify(graph, **options)
    with pytest.raises(cairn.Error, match="did you mean 'mac'"):
        cairn.sparsify_edges(graph, "mack")


def test_ctrl_c_ends_it():
    run = """
        import os, signal, threading
        import cairn
        signal.signal(signal.SIGINT, signal.default_int_handler)
        graph, _ = cairn.generate("manhattan", seed=3, poses=3000)
        threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        result = cairn.sparsify(graph, select="least_loss:part=0.9", tolerance=0, max_iterations=10**6)
        assert result.status == "interrupted", result
        print("went on")
    """
    ended = subprocess.run([sys.executable, "-c", textwrap.dedent(run)], capture_output=True, text=True, timeout=120)
    assert (ended.returncode, ended.stdout) == (0, "went on\n"), ended.stderr
