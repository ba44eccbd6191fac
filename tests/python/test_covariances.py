# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
import dense
from graphs import from_dense


def optimised():
    walk = dense.loop()
    walk.optimize()
    return walk, from_dense(walk)


def test_marginals_are_those_of_the_dense_inverse():
    walk, graph = optimised()
    ids = [3, 17, 24]
    sigma = cairn.marginals(graph, ids)
    assert sigma.shape == (3, 3, 3)
    for k, i in enumerate(ids):
        assert_allclose(sigma[k], walk.covariance(i, i), rtol=1e-6, atol=1e-9)


def test_cross_covariances_have_rows_of_the_first():
    walk, graph = optimised()
    pairs = [[3, 17], [17, 3], [5, 5]]
    sigma = cairn.cross_covariances(graph, pairs)
    for k, (i, j) in enumerate(pairs):
        assert_allclose(sigma[k], walk.covariance(i, j), rtol=1e-6, atol=1e-9)
    assert_allclose(sigma[0], sigma[1].T)


def test_every_solver_gives_the_same():
    _, graph = optimised()
    assert_allclose(
        cairn.marginals(graph, graph.ids()), cairn.marginals(graph, graph.ids(), linear_solver="eigen"), rtol=1e-9, atol=1e-12
    )


def test_fixed_variables_are_certain_and_none_is_an_empty_array():
    _, graph = optimised()
    assert not cairn.marginals(graph, [0]).any()
    assert cairn.marginals(graph, []).shape == (0, 0, 0)


def test_what_has_no_covariance_is_an_error():
    _, graph = optimised()
    graph.add(100, cairn.Pose2())
    with pytest.raises(cairn.Error, match="VERTEX_SE2 100: it has no factor") as raised:
        cairn.marginals(graph, [100])
    assert raised.value.kind == "numerical"
    with pytest.raises(cairn.Error, match="there is no variable 77"):
        cairn.marginals(graph, [77])
    graph.add(200, cairn.Point2(1, 1))
    graph.add(cairn.Observation(3, 200, cairn.Point2(1, 1)), sigmas=0.1)
    with pytest.raises(cairn.Error, match="ask for each type by itself"):
        cairn.marginals(graph, [3, 200])
    assert cairn.cross_covariances(graph, [[3, 200]]).shape == (1, 3, 2)
    with pytest.raises(cairn.Error, match=r"pairs: the shape is \(1, 3\)"):
        cairn.cross_covariances(graph, [[1, 2, 3]])
