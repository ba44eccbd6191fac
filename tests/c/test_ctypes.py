# SPDX-License-Identifier: BSD-3-Clause
"""cairn.h from Python's ctypes, against the oracle in plain NumPy; the package cairn is not used."""
import ctypes as c
import os
import sys

import numpy as np
import pytest

sys.path.insert(0, os.environ["CAIRN_TEST_DENSE"])
import dense

INTERRUPTED = 4


class Iteration(c.Structure):
    _fields_ = [("number", c.c_int), ("accepted", c.c_int), ("chi2", c.c_double), ("step_norm", c.c_double),
                ("damping", c.c_double), ("seconds", c.c_double)]


INTERRUPT = c.CFUNCTYPE(c.c_int, c.POINTER(Iteration), c.c_void_p)


class Stop(c.Structure):
    _fields_ = [("max_iterations", c.c_int), ("tolerance", c.c_double), ("max_seconds", c.c_double),
                ("interrupt", INTERRUPT), ("data", c.c_void_p)]


class Summary(c.Structure):
    _fields_ = [("status", c.c_int), ("iterations", c.c_int), ("initial_chi2", c.c_double),
                ("final_chi2", c.c_double), ("seconds", c.c_double)]


class Report(c.Structure):
    _fields_ = [("ok", c.c_int), ("converged", c.c_int), ("first_factor", c.c_int64), ("iterations", c.c_int),
                ("owed", c.c_int), ("seconds", c.c_double)]


class UpdateOptions(c.Structure):
    _fields_ = [("defer", c.c_int), ("full", c.c_int), ("max_seconds", c.c_double)]


lib = c.CDLL(os.environ["CAIRN_C_LIBRARY"])
lib.cairn_error.restype = c.c_char_p
lib.cairn_graph_notes.restype = c.c_char_p
lib.cairn_graph_notes.argtypes = [c.c_void_p]
lib.cairn_graph_doubts.restype = c.c_char_p
lib.cairn_graph_doubts.argtypes = [c.c_void_p]


def call(name, *arguments):
    code = getattr(lib, name)(*arguments)
    assert code == 0, lib.cairn_error().decode()


def doubles(array):
    array = np.ascontiguousarray(array, dtype=float)
    return array.ctypes.data_as(c.POINTER(c.c_double)), c.c_size_t(array.size), array


def add(handle, kind, tag, *rest):
    call(f"cairn_{kind}", handle, tag.encode(), *rest)


@pytest.fixture
def registry():
    handle = c.c_void_p()
    call("cairn_registry_new", None, c.c_size_t(0), c.byref(handle))
    yield handle
    lib.cairn_registry_free(handle)


def fill(handle, kind, oracle, with_states=True):
    """The oracle's graph, in a graph or as one update of an estimator."""
    for k, pose in enumerate(oracle.poses):
        state, size, _keep = doubles(pose if with_states or k == 0 else [])
        add(handle, f"{kind}_add_variable", "VERTEX_SE2", c.c_int64(k), state if size.value else None, size,
            c.c_int(k == 0))
    for i, j, z, information in oracle.edges:
        ends = (c.c_int64 * 2)(i, j)
        measurement, n, _keep = doubles(z)
        upper, m, _keep2 = doubles(information[np.triu_indices(3)])
        add(handle, f"{kind}_add_factor", "EDGE_SE2", ends, c.c_size_t(2), measurement, n, upper, m)


@pytest.fixture
def graph(registry):
    handle = c.c_void_p()
    call("cairn_graph_new", registry, c.byref(handle))
    fill(handle, "graph", dense.loop())
    yield handle
    lib.cairn_graph_free(handle)


def states(graph, count):
    out = np.zeros((count, 3))
    pointer, size, _keep = doubles(out)
    call("cairn_graph_states", graph, None, c.c_size_t(0), pointer, size)
    return out


def test_chi2_and_the_minimum_are_those_of_the_oracle(graph):
    oracle = dense.loop()
    chi2 = c.c_double()
    call("cairn_graph_chi2", graph, c.byref(chi2))
    assert chi2.value == pytest.approx(oracle.chi2(), rel=1e-12)
    summary = Summary()
    call("cairn_graph_optimize", graph, b"dogleg:linear_solver=eigen", None, None, c.byref(summary))
    assert summary.status == 0 and summary.iterations > 0
    assert summary.final_chi2 == pytest.approx(oracle.optimize(), rel=1e-9)
    assert np.abs(states(graph, len(oracle.poses)) - oracle.poses).max() < 1e-6


def test_marginals_are_those_of_the_oracle(graph):
    oracle = dense.loop()
    oracle.optimize()
    count = len(oracle.poses)
    call("cairn_graph_optimize", graph, None, None, None, None)
    ids = (c.c_int64 * (count - 1))(*range(1, count))
    blocks = np.zeros((count - 1, 3, 3))
    pointer, size, _keep = doubles(blocks)
    call("cairn_graph_marginals", graph, ids, c.c_size_t(count - 1), None, pointer, size)
    for k in range(1, count):
        expected = oracle.covariance(k, k)
        assert np.abs(blocks[k - 1] - expected).max() < 1e-5 * np.abs(expected).max()
    cross = np.zeros((3, 3))  # not symmetric: rows are those of the first
    pointer, size, _keep = doubles(cross)
    call("cairn_graph_covariance", graph, c.c_int64(4), c.c_int64(9), None, pointer, size)
    expected = oracle.covariance(4, 9)
    assert np.abs(expected - expected.T).max() > 1e-3 * np.abs(expected).max()
    assert np.abs(cross - expected).max() < 1e-5 * np.abs(expected).max()


def test_an_estimator_ends_where_the_oracle_does(registry):
    oracle = dense.loop()
    handle = c.c_void_p()
    call("cairn_estimator_new", registry, None, c.byref(handle))
    fill(handle, "estimator", oracle, with_states=False)
    report = Report()
    call("cairn_estimator_update", handle, c.byref(UpdateOptions(full=1)), c.byref(report))
    assert report.ok and report.converged and report.first_factor == 0
    oracle.optimize()
    pose, Sigma = np.zeros(3), np.zeros((3, 3))
    pointer, size, _keep = doubles(pose)
    call("cairn_estimator_estimate", handle, c.c_int64(15), pointer, size)
    assert np.abs(pose - oracle.poses[15]).max() < 1e-6
    pointer, size, _keep = doubles(Sigma)
    call("cairn_estimator_covariance", handle, c.c_int64(15), c.c_int64(6), pointer, size)
    expected = oracle.covariance(15, 6)
    assert np.abs(Sigma - expected).max() < 1e-5 * np.abs(expected).max()
    lib.cairn_estimator_free(handle)


def test_a_function_in_python_stops_an_optimisation(graph):
    seen = []

    def interrupt(iteration, _data):
        seen.append((iteration.contents.number, iteration.contents.chi2))
        return len(seen) == 1

    stop = Stop()
    lib.cairn_stop_init(c.byref(stop))
    assert stop.max_iterations == 200 and stop.tolerance == 1e-10
    stop.interrupt = INTERRUPT(interrupt)
    summary = Summary()
    call("cairn_graph_optimize", graph, b"gauss_newton", b"as_given", c.byref(stop), c.byref(summary))
    assert summary.status == INTERRUPTED and len(seen) == 1 == summary.iterations
    assert seen[0] == (1, summary.final_chi2)


def test_an_initial_guess_is_stopped_too(graph):
    numbers = []

    def interrupt(iteration, _data):
        numbers.append(iteration.contents.number)
        return 1

    stop = Stop()
    lib.cairn_stop_init(c.byref(stop))
    stop.interrupt = INTERRUPT(interrupt)
    summary = Summary()
    call("cairn_graph_optimize", graph, None, b"incremental", c.byref(stop), c.byref(summary))
    assert numbers == [0]
    assert summary.status == INTERRUPTED and summary.iterations == 0
    assert b"initial guess incremental: " in lib.cairn_graph_notes(graph)


def test_a_message_advises_nothing_that_c_lacks(registry, tmp_path):
    file = tmp_path / "other.g2o"
    handle = c.c_void_p()
    for content, option in [("VERTEX_SE2 0 0 0 0\nTHING 1\n", "--skip-unknown"),
                            ("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 7 1 0 0 1 0 0 1 0 1\n", "--skip-dangling"),
                            ("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0\n", "--unit-information")]:
        file.write_text(content)
        assert lib.cairn_graph_read(registry, str(file).encode(), None, c.byref(handle)) == 3
        message = lib.cairn_error().decode()
        assert f"cairn convert {option}" in message and "::" not in message


def test_what_speaks_against_an_estimate_is_told_from_its_notes(registry, tmp_path):
    file = tmp_path / "contradiction.g2o"
    file.write_text("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 0 1 90 0 0 1 0 0 1 0 1\n")
    graph = c.c_void_p()
    call("cairn_graph_read", registry, str(file).encode(), None, c.byref(graph))
    assert lib.cairn_graph_doubts(graph) == b""
    call("cairn_graph_optimize", graph, None, None, None, None)
    doubts = lib.cairn_graph_doubts(graph).splitlines()
    assert len(doubts) == 1 and b"hardly the right one" in doubts[0]
    assert doubts[0] in lib.cairn_graph_notes(graph).splitlines() and b"anchored" in lib.cairn_graph_notes(graph)
    lib.cairn_graph_free(graph)


def test_an_error_is_a_code_with_its_reason(registry):
    handle = c.c_void_p()
    assert lib.cairn_graph_read(registry, b"/nowhere.g2o", None, c.byref(handle)) == 3
    assert "/nowhere.g2o" in lib.cairn_error().decode()
    assert not handle
