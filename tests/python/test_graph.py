# SPDX-License-Identifier: BSD-3-Clause
import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
import dense
from graphs import from_dense


def small():
    graph = cairn.Graph()
    graph.add(cairn.X(0), cairn.Pose2(), fixed=True)
    graph.add(cairn.X(1), cairn.Pose2(1, 0, 0))
    graph.add(cairn.L(0), cairn.Point2(3, 1))
    graph.add(cairn.Between(cairn.X(0), cairn.X(1), cairn.Pose2(1.1, 0, 0)), sigmas=[0.1, 0.1, 0.05])
    graph.add(cairn.Observation(cairn.X(0), cairn.L(0), cairn.Point2(3.1, 0.9)), sigmas=0.2)
    graph.add(cairn.BearingRange(cairn.X(1), cairn.L(0), 0.45, 2.2), sigmas=[0.02, 0.1])
    return graph


def test_what_was_added_is_there():
    graph = small()
    assert graph.variable_types == {"VERTEX_SE2": 2, "VERTEX_XY": 1}
    assert graph.factor_types == {"EDGE_SE2": 1, "EDGE_SE2_XY": 1, "EDGE_BEARING_RANGE_SE2_XY": 1}
    assert graph.at(cairn.X(1)).equals(cairn.Pose2(1, 0, 0))
    assert isinstance(graph.at(cairn.L(0)), cairn.Point2)
    assert graph.fixed == [cairn.X(0)]
    assert cairn.X(1) in graph and cairn.X(2) not in graph
    assert graph.factor(0).ids == [cairn.X(0), cairn.X(1)]
    assert repr(graph.factor(0)) == "<EDGE_SE2 x0 x1: 1.1 0 0>"
    assert repr(graph).startswith("<cairn.Graph: 3 variables (2 VERTEX_SE2, 1 VERTEX_XY), 3 factors")


def test_chi2_is_that_of_the_definition():
    graph = small()
    bearing, distance = np.arctan2(1, 2), np.hypot(1, 2)
    by_hand = [(0.1 / 0.1) ** 2, 2 * (0.1 / 0.2) ** 2, ((bearing - 0.45) / 0.02) ** 2 + ((distance - 2.2) / 0.1) ** 2]
    assert_allclose(graph.squared_norms(), by_hand, rtol=1e-12)
    assert_allclose(graph.chi2(), sum(by_hand), rtol=1e-12)
    walk = dense.loop()
    walk.poses[1:] += 0.1
    assert_allclose(from_dense(walk).chi2(), walk.chi2(), rtol=1e-12)


def test_information_is_given_in_three_ways():
    sigmas = np.array([0.1, 0.2, 0.05])
    ways = [{"sigmas": sigmas}, {"information": np.diag(sigmas**-2)}, {"covariance": np.diag(sigmas**2)}]
    for way in ways:
        graph = small()
        graph.add(cairn.Prior(cairn.X(1), cairn.Pose2(0, 0, 0.3)), **way)
        assert_allclose(graph.squared_norms()[-1], (np.cos(0.3) / 0.1) ** 2 + (np.sin(0.3) / 0.2) ** 2 + (0.3 / 0.05) ** 2, rtol=1e-12)
    for way, message in [
        ({}, "how certain is the measurement"),
        ({"sigmas": 1, "information": np.eye(3)}, "not several"),
        ({"sigmas": [1, 2]}, r"sigmas: the shape is \(2,\)"),
        ({"information": np.eye(2)}, r"information: the shape is \(2, 2\), expected \(3, 3\)"),
        ({"information": -np.eye(3)}, "not positive"),
        ({"information": np.triu(np.ones((3, 3)))}, "symmetric"),
        ({"sigmas": "wide"}, "sigmas: expected numbers"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            small().add(cairn.Prior(cairn.X(1), cairn.Pose2()), **way)


def test_what_is_not_measured_has_an_infinite_sigma():
    graph = small()
    graph.add(cairn.Prior(cairn.X(1), cairn.Pose2(0, 0, 2.5)), sigmas=[0.5, 0.5, np.inf])
    assert_allclose(graph.squared_norms()[-1], 4)


def test_a_part_of_a_pose_has_a_type_of_its_own():
    for yaw in (0.0, 1.0, 2.0, 3.0):  # what is not measured changes nothing
        graph = cairn.Graph()
        turn = cairn.Rot3.from_roll_pitch_yaw(0, 0, yaw) * cairn.Rot3.from_roll_pitch_yaw(0.01, 0, 0)
        graph.add(0, cairn.Pose3(turn, cairn.Point3(3, 4, 5)))
        graph.add(cairn.Position(0, cairn.Point3(2, 4, 7)), sigmas=[1, 1, np.inf])
        graph.add(cairn.Direction(0, cairn.Point3(0, 0, -9.81), cairn.Point3(0, 0, -1)), sigmas=0.01)
        graph.add(cairn.Orientation(0, cairn.Rot3.from_roll_pitch_yaw(0, 0, yaw)), sigmas=0.01)
        graph.add(cairn.Prior(0, cairn.Pose3(cairn.Rot3(), cairn.Point3(2, 4, 7))), sigmas=[1, 1, np.inf, np.inf, np.inf, np.inf])
        assert_allclose(graph.squared_norms(), [1, 1, 1, 1], rtol=1e-4)
        assert repr(graph.factor(1)) == "<EDGE_SE3_PRIORVEC 0: 0 0 -1 0 0 -1>"
    plane = cairn.Graph()
    plane.add(0, cairn.Pose2(1, 2, 3))
    plane.add(cairn.Position(0, cairn.Point2(1, 3)), sigmas=0.5)
    assert_allclose(plane.squared_norms(), [4])
    for make, message in [
        (lambda: cairn.Position(0, cairn.Pose2()), "Position: .* not a Pose2"),
        (lambda: cairn.Orientation(0, 1.5), "Orientation: .* not a float"),
        (lambda: cairn.Direction(0, [0, 0, 1], [0, 0, 1]), "Direction: .* not a list"),
    ]:
        with pytest.raises(TypeError, match=message):
            make()


def test_any_type_goes_by_its_tag():
    graph = cairn.Graph()
    graph.add(0, [0, 0, 0], type="VERTEX_SE2")
    graph.add(1, [1, 0, 0], type=cairn.Pose2)
    graph.add(cairn.Measurement("EDGE_SE2", [0, 1], [1, 0, 0.5]), sigmas=1)
    assert_allclose(graph.chi2(), 0.25)
    with pytest.raises(cairn.Error, match="EDGE_SE2"):
        graph.add(cairn.Measurement("EDGE_SE22", [0, 1], [1, 0, 0.5]), sigmas=1)


def test_a_loss_is_of_its_factor():
    graph = small()
    graph.add(cairn.Between(cairn.X(0), cairn.X(1), cairn.Pose2(3, 0, 0)), sigmas=1, loss="huber:scale=1")
    without = graph.squared_norms().sum()
    assert_allclose(graph.chi2(), without - 4 + (2 * 2 - 1))  # rho(s) = 2 sqrt(s) - 1 beyond 1
    graph.set_loss(None)
    assert_allclose(graph.chi2(), without)
    graph.set_loss("cauchy:scale=2", on="EDGE_SE2_XY")
    assert_allclose(graph.chi2(), without - 0.5 + 4 * np.log1p(0.5 / 4))
    with pytest.raises(cairn.Error, match="neither 'all', 'loops' nor a type of factors"):
        graph.set_loss("cauchy", on="EDGE")


def test_removal_takes_the_factors_along():
    graph = small()
    graph.remove(variables=[cairn.L(0)])
    assert graph.factor_types == {"EDGE_SE2": 1}
    graph.remove(factors=[0])
    assert graph.factor_count == 0 and graph.variable_count == 2
    for call in [dict(factors=[7]), dict(variables=[7])]:
        with pytest.raises(cairn.Error, match="there is no"):
            graph.remove(**call)


def test_copies_are_independent():
    graph = small()
    for other in [graph.copy(), copy.copy(graph), copy.deepcopy(graph)]:
        other.fix(cairn.X(1))
        other.remove(factors=[0])
        assert graph.factor_count == 3 and graph.fixed == [cairn.X(0)]
    graph.fix([cairn.X(0), cairn.X(1)], False)
    assert graph.fixed == []


def test_errors_carry_the_message_and_the_kind():
    graph = small()
    with pytest.raises(cairn.Error, match="VERTEX_SE2 .*: the id is already that of VERTEX_SE2 x1") as raised:
        graph.add(cairn.X(1), cairn.Pose2())
    assert raised.value.kind == "input" and isinstance(raised.value, RuntimeError)
    with pytest.raises(cairn.Error, match="there is no variable x7 in the graph") as raised:
        graph.at(cairn.X(7))
    assert raised.value.kind == "usage"
    with pytest.raises(cairn.Error, match="there is no factor 12"):
        graph.factor(12)


def test_ids_below_zero_are_refused():
    graph = small()
    with pytest.raises(cairn.Error, match="the id -1 is below 0: ids are from 0, as in files"):
        graph.add(-1, cairn.Pose2())
    with pytest.raises(cairn.Error, match="the id -2 is below 0"):
        graph.add_variables(cairn.Point2, [5, -2], [[0, 0], [1, 1]])
    with pytest.raises(cairn.Error, match="the id -1 is below 0"):
        cairn.Estimator().add(-1, cairn.Pose2())
    assert graph.variable_count == 3


def test_calls_that_do_not_fit_say_what_does():
    graph = small()
    for call, message in [
        (lambda: graph.add("x0", cairn.Pose2()), r"an id is an integer, not the text 'x0'; cairn.symbol\('x', 0\) makes one of it"),
        (lambda: cairn.Estimator().add("x0", cairn.Pose2()), "not the text 'x0'"),
        (lambda: graph.add(cairn.Pose2()), "add takes an id and a value"),
        (lambda: graph.add(cairn.Between(0, 1, cairn.Pose2()), 0.1), "a measurement with its noise by name"),
        (lambda: graph.remove(0), r"remove takes what leaves by name: remove\(variables=ids\)"),
        (lambda: graph.states(), "of which type.* the graph has VERTEX_SE2, VERTEX_XY"),
        (lambda: graph.positions(), "of which type.* the graph has EDGE_"),
        (lambda: cairn.Between(0, 1, (1, 0, 0)), r"Between: what is measured is a value such as Pose2\(1, 0, 0\) or a Pose3, not a tuple"),
        (lambda: cairn.Between("x0", 1, cairn.Pose2()), "not the text 'x0'"),
        (lambda: cairn.Prior(0, [1, 2]), "Prior: .* not a list"),
        (lambda: cairn.Observation(0, 1, (1, 2)), "Observation: .* not a tuple"),
    ]:
        with pytest.raises(TypeError, match=message):
            call()
    graph.remove(factors=0)
    graph.remove(variables=cairn.L(0))
    assert graph.variable_count == 2
    graph.add(np.int64(7), cairn.Pose2(), 1)
    graph.add(8, cairn.Pose2(), fixed=np.True_)
    assert graph.fixed == [cairn.X(0), 7, 8]
