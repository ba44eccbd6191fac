# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import cairn
import dense
from graphs import arrays_of, from_dense


def bulk(walk, **noise):
    ids, states, pairs, measurements, information = arrays_of(walk)
    graph = cairn.Graph()
    graph.add_variables("VERTEX_SE2", ids, states)
    graph.add_factors("EDGE_SE2", pairs, measurements, **(noise or {"information": information}))
    graph.fix(0)
    return graph


def test_in_bulk_it_is_the_same_graph_as_one_by_one():
    walk = dense.loop()
    one_by_one, at_once = from_dense(walk), bulk(walk)
    assert_array_equal(at_once.states("VERTEX_SE2"), one_by_one.states(cairn.Pose2))
    assert_array_equal(at_once.squared_norms(), one_by_one.squared_norms())
    assert at_once.fixed == one_by_one.fixed


def test_arrays_come_back_as_they_went_in():
    walk = dense.loop()
    ids, states, pairs, measurements, information = arrays_of(walk)
    graph = bulk(walk)
    assert_array_equal(graph.ids(), ids)
    assert_array_equal(graph.ids(cairn.Pose2), ids)
    assert_array_equal(graph.states(cairn.Pose2), states)
    assert_array_equal(graph.factor_ids("EDGE_SE2"), pairs)
    assert_array_equal(graph.measurements("EDGE_SE2"), measurements)
    assert_array_equal(graph.information("EDGE_SE2"), information)
    assert_array_equal(graph.positions("EDGE_SE2"), np.arange(len(pairs)))


def test_information_has_several_shapes():
    walk = dense.loop()
    *_, information = arrays_of(walk)
    upper = np.array([omega[np.triu_indices(3)] for omega in information])
    assert_array_equal(bulk(walk, information=upper).information("EDGE_SE2"), information)
    n = len(information)
    for noise in [
        dict(information=np.diag([4.0, 25.0, 100.0])),
        dict(sigmas=[0.5, 0.2, 0.1]),
        dict(sigmas=np.tile([0.5, 0.2, 0.1], (n, 1))),
    ]:
        assert_allclose(bulk(walk, **noise).information("EDGE_SE2"), np.tile(np.diag([4, 25, 100]), (n, 1, 1)))
    assert_allclose(bulk(walk, sigmas=0.5).information("EDGE_SE2")[3], 4 * np.eye(3))


def test_information_of_single_precision_may_be_singular():
    rng = np.random.default_rng(1)
    indefinite = 0
    for k in range(50):
        root = rng.normal(size=(3, 2)) * 10 ** rng.uniform(0, 3, size=2)
        information = (root @ root.T).astype(np.float32)
        indefinite += np.linalg.eigvalsh(information.astype(float))[0] < -1e-9 * information.max()
        graph = cairn.Graph()
        graph.add_variables("VERTEX_SE2", [0, 1], np.zeros((2, 3)))
        graph.add(cairn.Between(0, 1, cairn.Pose2(1, 0, 0)), information=information)
        graph.add_factors("EDGE_SE2", [[0, 1]], [[1, 0, 0]], information=information)
        assert_allclose(graph.squared_norms(), information[0, 0], rtol=1e-5)
        doubles = information.astype(float) * (1 + 1e-12)  # refused where they are no floats
        if np.linalg.eigvalsh(doubles)[0] < -1e-9 * doubles.max():
            with pytest.raises(cairn.Error, match="not positive semidefinite"):
                graph.add(cairn.Between(0, 1, cairn.Pose2(1, 0, 0)), information=doubles)
    assert indefinite > 10
    # An inverse of floats is not symmetric to the digits of doubles.
    covariance = np.array([[2, 1.9, 0.3], [1.9, 2, 0.31], [0.3, 0.31, 0.1]], dtype=np.float32)
    skew = np.linalg.inv(covariance)
    skew[0, 1] *= np.float32(1 + 1e-6)
    graph.add(cairn.Between(0, 1, cairn.Pose2(1, 0, 0)), information=skew)
    graph.add_factors("EDGE_SE2", [[0, 1]], [[1, 0, 0]], information=skew)
    with pytest.raises(cairn.Error, match="symmetric"):
        graph.add(cairn.Between(0, 1, cairn.Pose2(1, 0, 0)), information=skew.astype(float) + np.triu(np.full((3, 3), 1e-6), 1))


def test_any_layout_of_memory_will_do():
    walk = dense.loop()
    ids, states, pairs, measurements, information = arrays_of(walk)
    graph = cairn.Graph()
    graph.add_variables(cairn.Pose2, ids.astype(np.int32).tolist(), np.asfortranarray(states))
    graph.add_factors("EDGE_SE2", np.asfortranarray(pairs), measurements[::-1][::-1], np.asfortranarray(information))
    assert_array_equal(graph.squared_norms(), bulk(walk).squared_norms())


def test_in_many_small_parts_it_is_the_same_graph():
    walk = dense.loop()
    ids, states, pairs, measurements, information = arrays_of(walk)
    graph = cairn.Graph()
    added = 0
    for k in range(len(ids)):
        graph.add_variables("VERTEX_SE2", ids[k : k + 1], states[k : k + 1])
        while added < len(pairs) and np.isin(pairs[added], ids[: k + 1]).all():
            one = slice(added, added + 1)
            graph.add_factors("EDGE_SE2", pairs[one], measurements[one], information=information[one])
            added += 1
    graph.fix(0)
    whole = bulk(walk)
    assert_array_equal(graph.factor_ids("EDGE_SE2"), whole.factor_ids("EDGE_SE2"))
    assert_array_equal(graph.squared_norms(), whole.squared_norms())


def test_an_error_leaves_the_graph_as_it_was():
    walk = dense.loop()
    ids, states, pairs, measurements, information = arrays_of(walk)
    graph = bulk(walk)
    chi2, contents = graph.chi2(), (graph.variable_count, graph.factor_count)

    def refused(message, call, *args, **kwargs):
        with pytest.raises(cairn.Error, match=message):
            call(*args, **kwargs)
        assert (graph.variable_count, graph.factor_count) == contents
        assert graph.chi2() == chi2

    refused("the id is already that of", graph.add_variables, cairn.Pose2, ids[::-1] + 3, states)
    refused("not finite", graph.add_variables, cairn.Pose2, ids + 100, np.where(states > 3, np.nan, states))
    refused(r"states: the shape is \(25, 2\), expected \(25, 3\)", graph.add_variables, cairn.Pose2, ids + 100, states[:, :2])
    refused("expected integers", graph.add_variables, cairn.Pose2, ids + 0.5, states)
    refused(r"ids\[13\]: there is no variable 25 in the graph", graph.add_factors, "EDGE_SE2", pairs + 12, measurements, information)
    worse = information.copy()
    worse[17] *= -1
    refused("not positive", graph.add_factors, "EDGE_SE2", pairs, measurements, worse)
    worse[17, 0, 1] += 1
    refused(r"information\[17\] is not symmetric", graph.add_factors, "EDGE_SE2", pairs, measurements, worse)
    refused(r"information: the shape", graph.add_factors, "EDGE_SE2", pairs, measurements, information[1:])
    refused(r"ids: the shape is \(37, 3\), and EDGE_SE2 joins 2", graph.add_factors, "EDGE_SE2", np.c_[pairs, pairs[:, 0]], measurements, information)
    refused("give sigmas=|Give sigmas=", graph.add_factors, "EDGE_SE2", pairs, measurements)
    refused("EDGE_SE2", graph.add_factors, "EDGE_SE", pairs, measurements, information)


def test_states_are_replaced_whole_or_in_part():
    graph = bulk(dense.loop())
    states = graph.states(cairn.Pose2) + 0.25
    states[:, 2] = dense.wrap(states[:, 2])
    graph.set_states(cairn.Pose2, states)
    assert_allclose(graph.states(cairn.Pose2), states, atol=1e-15)
    graph.set_states(cairn.Pose2, [[1, 2, 0.5], [3, 4, 0.25]], ids=[5, 2])
    assert graph.at(2).equals(cairn.Pose2(3, 4, 0.25)) and graph.at(5).equals(cairn.Pose2(1, 2, 0.5))
    with pytest.raises(cairn.Error):
        graph.set_states(cairn.Pose2, [[9, 9, 0], [np.nan, 4, 0.25]], ids=[5, 2])
    assert graph.at(5).equals(cairn.Pose2(1, 2, 0.5))
    with pytest.raises(cairn.Error, match="there is no VERTEX_XY in the graph"):
        graph.states(cairn.Point2)


def test_ids_may_be_far_apart():
    graph = cairn.Graph()
    graph.add_variables(cairn.Pose2, [cairn.X(0), cairn.X(1), 5], np.zeros((3, 3)))
    graph.add_variables("VERTEX_XY", [cairn.L(7), 2**62], [[1, 2], [3, 4]])
    pairs = [[cairn.X(1), cairn.L(7)], [5, 2**62], [cairn.X(0), cairn.L(7)]]
    graph.add_factors("EDGE_SE2_XY", pairs, [[0, 2], [3, 3], [1, 4]], sigmas=1)
    assert_allclose(graph.squared_norms(), [1, 1, 4])
    with pytest.raises(cairn.Error, match=r"ids\[1\]: there is no variable l8"):
        graph.add_factors("EDGE_SE2_XY", [pairs[0], [5, cairn.L(8)]], [[0, 2], [3, 3]], sigmas=1)


def test_an_unsigned_id_that_is_no_id_is_refused():
    graph = cairn.Graph()
    graph.add_variables(cairn.Pose2, np.array([3, 2**63 - 1], dtype=np.uint64), np.zeros((2, 3)))
    assert list(graph.ids(cairn.Pose2)) == [3, 2**63 - 1]
    with pytest.raises(cairn.Error, match="9223372036854775808 is larger than any id"):
        graph.add_variables(cairn.Pose2, np.array([2**63], dtype=np.uint64), np.zeros((1, 3)))


def test_arrays_are_copies():
    graph = bulk(dense.loop())
    graph.states(cairn.Pose2)[:] = 0
    assert graph.states(cairn.Pose2).any()


def test_a_loss_in_bulk_is_of_these_factors():
    walk = dense.loop()
    ids, states, pairs, measurements, information = arrays_of(walk)
    graph = bulk(walk)
    before = graph.chi2()
    graph.add_factors("EDGE_SE2", pairs, measurements, information, loss="cauchy:scale=1")
    assert_allclose(graph.chi2(), before + np.log1p(bulk(walk).squared_norms()).sum())


def test_factors_are_added_by_the_class_of_their_measurements():
    walk = dense.loop()
    ids, states, pairs, measurements, information = arrays_of(walk)
    graph, other = cairn.Graph(), bulk(walk)
    graph.add_variables(cairn.Pose2, ids, [cairn.Pose2(*state) for state in states])
    graph.add_factors(cairn.Between, pairs, [cairn.Pose2(*z) for z in measurements], information)
    assert_array_equal(graph.squared_norms(), other.squared_norms())
    assert_array_equal(graph.measurements(cairn.Between), other.measurements("EDGE_SE2"))
    graph.add_factors(cairn.Prior, [[0]], (cairn.Pose2(),), sigmas=1)
    graph.add_variables("VERTEX_SE3:QUAT", [100, 101], [cairn.Pose3()] * 2)
    graph.add_factors(cairn.Between, [[100, 101]], [cairn.Pose3()], sigmas=1)
    graph.add_variables(cairn.Point2, [200], [[1, 1]])
    graph.add_factors(cairn.BearingRange, [[0, 200]], [[0.5, 1]], sigmas=1)
    assert graph.factor_types == {"EDGE_SE2": len(pairs), "EDGE_PRIOR_SE2": 1, "EDGE_SE3:QUAT": 1, "EDGE_BEARING_RANGE_SE2_XY": 1}
    for call, message in [
        (lambda: graph.measurements(cairn.Between), "a Between is of one of several types: give the tag, 'EDGE_SE2' or 'EDGE_SE3:QUAT'"),
        (lambda: graph.add_factors(cairn.Between, [[0, 200]], [[0, 0, 0]], sigmas=1), r"ids\[0\]: no Between is on VERTEX_SE2 and VERTEX_XY"),
        (lambda: graph.add_factors(7, [[0, 1]], [[0, 0, 0]], sigmas=1), "or by a class such as cairn.Pose2 or cairn.Between"),
        (lambda: cairn.Measurement(cairn.Between, [0, 1], [0, 0, 0]), "a Between is of one of several types"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            call()
