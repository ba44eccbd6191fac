# SPDX-License-Identifier: BSD-3-Clause
import json
import os
import subprocess
import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
import dense
from graphs import from_dense


def disturbed():
    walk = dense.loop()
    walk.poses[1:] += np.random.default_rng(1).normal(scale=0.05, size=(len(walk.poses) - 1, 3))
    return walk


@pytest.mark.parametrize("optimizer", ["gauss_newton", "levenberg_marquardt", "dogleg"])
@pytest.mark.parametrize("linear_solver", ["block_cholesky", "eigen"])
def test_the_minimum_is_that_of_dense_gauss_newton(optimizer, linear_solver):
    walk = disturbed()
    graph = from_dense(walk)
    summary = cairn.optimize(graph, optimizer, linear_solver=linear_solver, initial=None)
    assert_allclose(summary.initial_chi2, walk.chi2(), rtol=1e-12)
    least = walk.optimize()
    assert summary.converged and summary.status == "converged"
    assert_allclose(summary.chi2, least, rtol=1e-9)
    assert_allclose(graph.chi2(), summary.chi2, rtol=1e-12)
    assert_allclose(graph.states(cairn.Pose2), walk.poses, atol=1e-6)
    assert summary.optimizer.startswith(optimizer) and linear_solver in summary.linear_solver
    assert summary.iterations[-1].chi2 == summary.chi2
    assert [it.number for it in summary.iterations] == list(range(1, len(summary.iterations) + 1))


def test_a_summary_says_that_its_limit_ended_it():
    summary = cairn.optimize(from_dense(disturbed()), initial=None, max_iterations=1)
    assert not summary.converged and "stopped by max_iterations 1 before it converged" in summary.notes
    summary = cairn.optimize(from_dense(disturbed()), initial=None, max_iterations=1, tolerance=0)
    assert not any("stopped by" in note for note in summary.notes)


def test_what_speaks_against_an_estimate_is_told_from_what_informs():
    graph = from_dense(disturbed())
    graph.fix(graph.fixed, False)
    summary = cairn.optimize(graph, initial=None)
    assert summary.converged and summary.doubts == [] and any("anchored" in note for note in summary.notes)
    graph.add(cairn.Between(3, 9, cairn.Pose2(9, 9, 0)), sigmas=0.02)
    summary = cairn.optimize(graph, initial=None)
    assert summary.converged and len(summary.doubts) == 1 and "hardly the right one" in summary.doubts[0]
    assert set(summary.doubts) < set(summary.notes)
    summary = cairn.optimize(from_dense(disturbed()), initial=None, max_iterations=1)
    assert "stopped by max_iterations 1 before it converged" in summary.doubts


def test_states_that_are_too_large_end_no_process():
    if "ceres_line_search" not in cairn.components("optimizer"):
        pytest.skip("there is no optimizer ceres_line_search")
    graph = from_dense(disturbed())
    graph.set_states(cairn.Pose2, graph.states(cairn.Pose2) * [1e307, 1.0, 1.0])
    summary = cairn.optimize(graph, "ceres_line_search", initial=None)
    assert summary.status == "diverged" and not np.isfinite(summary.initial_chi2)
    assert not summary.iterations


def test_it_does_what_the_program_does(tmp_path):
    graph, _ = cairn.generate("manhattan", seed=3, poses=300)
    graph.write(tmp_path / "in.g2o")
    command = [os.environ["CAIRN_PROGRAM"], "optimize", "in.g2o", "--json", "run.json", "--quiet"]
    subprocess.run(command + ["--optimizer", "dogleg", "--linear-solver", "eigen"], cwd=tmp_path, check=True)
    program = json.loads((tmp_path / "run.json").read_text())
    summary = cairn.optimize(cairn.read(tmp_path / "in.g2o"), "dogleg", linear_solver="eigen")
    assert summary.chi2 == program["chi2"]["final"]
    assert len(summary.iterations) == len(program["iterations"])
    assert summary.status == program["status"]


def test_options_are_keyword_arguments():
    summary = cairn.optimize(from_dense(disturbed()), "dogleg", linear_solver="eigen", max_iterations=1, tolerance=0)
    assert len(summary.iterations) == 1 and summary.status == "max_iterations"
    nested = cairn.spec("block_cholesky", ordering="amd")
    assert nested == "block_cholesky:ordering=amd"
    assert cairn.optimize(from_dense(disturbed()), "gauss_newton", linear_solver=nested).converged
    assert cairn.optimize(from_dense(disturbed()), "dogleg:linear_solver=eigen").linear_solver == "eigen"
    for call, message in [
        (dict(optimizer="doglegs"), "dogleg"),
        (dict(optimizer="dogleg", linear_solvr="eigen"), "linear_solver"),
        (dict(optimizer="dogleg", linear_solver="eigenn"), "eigen"),
        (dict(optimizer="dogleg:linear_solver=eigen", linear_solver="eigen"), "given twice"),
        (dict(optimizer="dogleg", linear_solver=[1]), "neither a number nor a text"),
        (dict(max_iterations=-1), "max_iterations=-1: expected 0 or more"),
        (dict(tolerance=2), "tolerance=2: expected a fraction"),
        (dict(initial="guess"), "guess"),
        (dict(loss="cauchi"), "cauchy"),
        (dict(loss_on="loops"), "there is no loss"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            cairn.optimize(from_dense(disturbed()), **call)


def test_the_initial_estimate_is_chosen_unless_told_otherwise():
    walk = disturbed()
    walk.poses[1:, 2] = np.random.default_rng(0).uniform(-3, 3, size=len(walk.poses) - 1)
    as_given = cairn.optimize(from_dense(walk), initial=None)
    assert_allclose(as_given.initial_chi2, walk.chi2(), rtol=1e-12)
    chosen = cairn.optimize(from_dense(walk))
    assert chosen.initial_chi2 < 0.01 * as_given.initial_chi2
    assert any(note.startswith("initial guess auto: ") for note in chosen.notes)


def test_a_loss_holds_a_wrong_loop_closure_off():
    walk = disturbed()
    graph = from_dense(walk)
    wrong = cairn.Between(3, 9, cairn.Pose2(9, 9, 0))
    graph.add(wrong, sigmas=0.1)
    bent = graph.copy()
    cairn.optimize(bent, initial=None)
    robust = cairn.optimize(graph, loss="cauchy:scale=1", loss_on="loops", initial=None)
    walk.optimize()

    def furthest(graph):
        return np.hypot(*(graph.states(cairn.Pose2) - walk.poses)[:, :2].T).max()

    assert robust.converged and furthest(graph) < 0.3 and furthest(bent) > 2


def test_a_callback_sees_every_iteration_and_its_states():
    graph = from_dense(disturbed())
    seen = []

    def callback(iteration):
        seen.append((iteration, iteration.states(cairn.Pose2)))

    summary = cairn.optimize(graph, callback=callback)
    assert [it.chi2 for it, _ in seen] == [it.chi2 for it in summary.iterations]
    assert_allclose(seen[-1][1], graph.states(cairn.Pose2))
    with pytest.raises(cairn.Error, match="while the callback runs"):
        seen[0][0].states(cairn.Pose2)


def test_a_callback_may_stop_it():
    graph = from_dense(disturbed())
    before = graph.chi2()
    summary = cairn.optimize(graph, tolerance=0, initial=None, callback=lambda iteration: iteration.number < 2)
    assert summary.status == "interrupted" and len(summary.iterations) == 2
    assert_allclose(graph.chi2(), summary.chi2, rtol=1e-12)
    assert summary.chi2 < before


def test_what_a_callback_raises_arrives():
    graph = from_dense(disturbed())
    before = graph.chi2()

    def callback(iteration):
        raise ZeroDivisionError("of the callback")

    with pytest.raises(ZeroDivisionError, match="of the callback"):
        cairn.optimize(graph, initial=None, callback=callback)
    assert graph.chi2() < before  # the best estimate so far


def test_the_graph_is_not_touched_while_it_is_optimised():
    graph = from_dense(disturbed())
    refusals = []

    def callback(iteration):
        for use in [graph.chi2, lambda: graph.add(99, cairn.Pose2()), lambda: cairn.optimize(graph)]:
            with pytest.raises(cairn.Error, match="the graph is in use") as raised:
                use()
            refusals.append(raised.value.kind)

    cairn.optimize(graph, callback=callback)
    assert refusals and set(refusals) == {"usage"}
    assert graph.chi2() > 0


def test_other_threads_run_meanwhile():
    graph, _ = cairn.generate("manhattan", seed=1, poses=2000)
    graphs = [graph.copy() for _ in range(2)]
    results = [None, None]
    inside = threading.Barrier(2, timeout=60)

    def solve(k):
        # Both wait in their first callback until the other is there: each runs while the other has not returned.
        results[k] = cairn.optimize(graphs[k], callback=lambda it: inside.wait() if it.number == 1 else None)

    threads = [threading.Thread(target=solve, args=[k]) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results[0].converged and results[0].chi2 == results[1].chi2


def test_a_summary_prints_itself():
    summary = cairn.optimize(from_dense(disturbed()))
    assert repr(summary).startswith("<cairn.Summary converged: chi2 ")
    assert str(summary).startswith("converged: chi2 ")
    assert 0 < summary.seconds["factorize"] < summary.seconds["total"]


def test_a_graph_that_is_not_determined_is_a_status():
    graph = cairn.Graph()
    graph.add(0, cairn.Pose2(), fixed=True)
    graph.add(1, cairn.Pose2(1, 0, 0))
    graph.add(2, cairn.Point2(1, 1))
    graph.add(cairn.Measurement("EDGE_SE2", [0, 1], [1, 0, 0]), sigmas=[0.1, np.inf, np.inf])
    graph.add(cairn.Observation(1, 2, cairn.Point2(1, 1)), sigmas=0.1)
    assert cairn.optimize(graph, "gauss_newton", initial=None).status == "not_positive_definite"
