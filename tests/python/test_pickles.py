# SPDX-License-Identifier: BSD-3-Clause
"""Graphs pass between processes."""
import pickle
import subprocess
import sys

import numpy as np
import pytest

import cairn


def world(seed=3):
    graph, _ = cairn.generate("manhattan", seed, poses=120, streets=4)
    return graph


def same(graph, again):
    assert again.variable_count == graph.variable_count and again.factor_count == graph.factor_count
    assert np.array_equal(again.ids(), graph.ids()) and again.fixed == graph.fixed
    assert again.variable_types == graph.variable_types and again.factor_types == graph.factor_types
    for tag in graph.variable_types:
        assert np.array_equal(again.states(tag), graph.states(tag))
    for tag in graph.factor_types:
        for of in ("factor_ids", "measurements", "information", "positions"):
            assert np.array_equal(getattr(again, of)(tag), getattr(graph, of)(tag)), of
    assert again.chi2() == graph.chi2()
    assert np.array_equal(again.squared_norms(), graph.squared_norms())
    assert np.array_equal(again.stamps, graph.stamps) and again.notes == graph.notes


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_a_graph_is_the_same_from_a_pickle(protocol):
    graph = world()
    same(graph, pickle.loads(pickle.dumps(graph, protocol)))


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_values_in_every_protocol(protocol):
    for value in (cairn.Pose2(1, 2, 3), cairn.Point3(1, 2, 3), cairn.Pose3()):
        assert pickle.loads(pickle.dumps(value, protocol)) == value
    with pytest.raises(TypeError, match="pickle"):
        pickle.dumps(cairn.Between(0, 1, cairn.Pose2()), protocol)


def test_whatever_it_has(tmp_path):
    graph = world()
    graph.set_loss("cauchy:scale=2", "loops")
    graph.fix([3, 5])
    graph.add(1000, cairn.Point2(1, 2))
    graph.add(cairn.Observation(4, 1000, cairn.Point2(0.5, 0.5)), sigmas=0.1, loss="huber")
    graph.add(cairn.Prior(7, cairn.Pose2(1, 2, 3)), sigmas=[0.1, 0.2, np.inf])
    graph.remove(variables=[9], factors=[2])
    again = pickle.loads(pickle.dumps(graph))
    same(graph, again)
    assert again.chi2() < cairn.Graph().chi2() + again.squared_norms().sum()  # it has losses
    cairn.optimize(graph), cairn.optimize(again)
    assert np.array_equal(again.states(cairn.Pose2), graph.states(cairn.Pose2))
    (tmp_path / "t.tum").write_text("1.5 0 0 0 0 0 0 1\n2.5 1 0 0 0 0 0 1\n")
    same(cairn.read(tmp_path / "t.tum"), pickle.loads(pickle.dumps(cairn.read(tmp_path / "t.tum"))))
    space, _ = cairn.generate("sphere", 1, turns=3, poses_per_turn=8)
    same(space, pickle.loads(pickle.dumps(space)))
    same(cairn.Graph(), pickle.loads(pickle.dumps(cairn.Graph())))


def test_a_type_that_another_process_cannot_know_is_refused():
    graph = world()
    own = cairn.FactorType("EDGE_PICKLED", [cairn.Pose2], lambda x, z: x[:, :1] - z, residual_size=1, measurement_size=1)
    graph.add_factors(own, [[1]], [[0.5]], sigmas=1)
    with pytest.raises(cairn.Error, match="EDGE_PICKLED cannot be pickled: it is not known by its tag; cairn.register"):
        pickle.dumps(graph)
    cairn.register(own)
    same(graph, pickle.loads(pickle.dumps(graph)))


def test_what_is_damaged_is_an_error():
    make, (cls, *_), state = world().__reduce_ex__(2)[:3]
    for damaged in ((99,), state[:1] + ([],) + state[2:]):
        with pytest.raises((cairn.Error, TypeError, IndexError)):
            cls.__new__(cls).__setstate__(damaged)


def test_another_process_optimises_a_graph(tmp_path):
    graph = world()
    (tmp_path / "graph").write_bytes(pickle.dumps(graph))
    program = "import cairn, pickle, sys; print(repr(cairn.optimize(pickle.load(open(sys.argv[1], 'rb'))).chi2))"
    ended = subprocess.run([sys.executable, "-c", program, tmp_path / "graph"], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert float(ended.stdout) == cairn.optimize(graph).chi2
