# SPDX-License-Identifier: BSD-3-Clause
import gc
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn


def residual(pose, beacon, measured):
    return np.hypot(*(beacon - pose[:, :2]).T)[:, None] - measured


def jacobians(pose, beacon, measured):
    """By the steps of the pose in its own frame (forward, left, turn), and by the beacon's."""
    offset = beacon - pose[:, :2]
    u = offset / np.hypot(*offset.T)[:, None]
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    forward, left = c * u[:, 0] + s * u[:, 1], c * u[:, 1] - s * u[:, 0]
    return np.stack([-forward, -left, 0 * left], axis=-1)[:, None, :], u[:, None, :]


def distance(tag="EDGE_DISTANCE", residual=residual, jacobians=None):
    return cairn.FactorType(tag, [cairn.Pose2, "VERTEX_XY"], residual, residual_size=1, measurement_size=1, jacobians=jacobians)


BEACONS = np.array([[0.0, 0.0], [9, -2], [4, 11]])


def ranges(poses=60, seed=3):
    """A walk with odometry, some fixed poses, and (pose, beacon, range) with noise."""
    random = np.random.default_rng(seed)
    graph = cairn.Graph()
    truth = np.column_stack([5 + 4 * np.cos(np.arange(poses) / 8), 5 + 4 * np.sin(np.arange(poses) / 8), np.arange(poses) / 8 + np.pi / 2])
    graph.add_variables(cairn.Pose2, np.arange(poses), truth)
    for k in range(1, poses):
        step = cairn.Pose2(*truth[k - 1]).between(cairn.Pose2(*truth[k]))
        graph.add(cairn.Between(k - 1, k, step.retract(random.normal(scale=0.01, size=3))), sigmas=[0.05, 0.05, 0.02])
    graph.fix(0)
    graph.add_variables(cairn.Point2, 1000 + np.arange(3), BEACONS + random.normal(scale=0.5, size=(3, 2)))
    pairs = np.array([(k, 1000 + b) for k in range(poses) for b in range(3) if (k + b) % 2])
    z = np.hypot(*(BEACONS[pairs[:, 1] - 1000] - truth[pairs[:, 0], :2]).T) + random.normal(scale=0.1, size=len(pairs))
    return graph, pairs, z


def native(graph, pairs, z, **loss):
    """A bearing and range of which the bearing is not measured."""
    graph.add_factors("EDGE_BEARING_RANGE_SE2_XY", pairs, np.column_stack([0 * z, z]), sigmas=[np.inf, 0.1], **loss)


@pytest.mark.parametrize("given", [None, jacobians], ids=["differences", "given"])
@pytest.mark.parametrize("optimizer", ["gauss_newton", "dogleg", "ceres"])
def test_the_minimum_is_that_of_the_native_factor(given, optimizer):
    graph, pairs, z = ranges()
    other = graph.copy()
    graph.add_factors(distance(jacobians=given), pairs, z, sigmas=0.1)
    native(other, pairs, z)
    assert_allclose(graph.squared_norms(), other.squared_norms(), rtol=1e-12, atol=1e-12)
    options = dict(initial=None, max_iterations=100)
    ours, theirs = cairn.optimize(graph, optimizer, **options), cairn.optimize(other, optimizer, **options)
    assert ours.converged and theirs.converged
    assert_allclose(ours.chi2, theirs.chi2, rtol=1e-9)
    for type in [cairn.Pose2, cairn.Point2]:
        assert_allclose(graph.states(type), other.states(type), atol=1e-5)
    assert_allclose(cairn.marginals(graph, [5, 50]), cairn.marginals(other, [5, 50]), rtol=1e-4, atol=1e-9)
    assert not any("Jacobian" in note for note in ours.notes)


def test_losses_and_estimators_take_it_too():
    graph, pairs, z = ranges()
    other = graph.copy()
    z[::9] += 3
    graph.add_factors(distance(), pairs, z, sigmas=0.1, loss="cauchy:scale=1")
    native(other, pairs, z, loss="cauchy:scale=1")
    assert_allclose(cairn.optimize(graph, initial=None).chi2, cairn.optimize(other, initial=None).chi2, rtol=1e-7)
    type, chi2 = distance(), []
    for factor, sigmas in [(lambda b, r: cairn.Measurement(type, [0, b], [r]), 0.1), (lambda b, r: cairn.BearingRange(0, b, 0, r), [np.inf, 0.1])]:
        estimator = cairn.Estimator()
        estimator.add(0, cairn.Pose2(5, 5, 1))
        for b, beacon in enumerate(BEACONS):
            estimator.add(1000 + b, cairn.Point2(*beacon))
            estimator.add(cairn.Prior(1000 + b, cairn.Point2(*beacon)), sigmas=0.3)
            estimator.add(factor(1000 + b, np.hypot(*(beacon - 5)) + 0.2), sigmas=sigmas)
        estimator.add(cairn.Prior(0, cairn.Pose2(5, 5, 1)), sigmas=0.5)
        estimator.update(full=True)
        chi2.append(estimator.chi2())
    assert chi2[0] > 0.1
    assert_allclose(chi2[0], chi2[1], rtol=1e-7)


def test_several_numbers_are_whitened_by_their_information():
    # A relative position: native with correlated information, and written in Python.
    def seen(pose, landmark, measured):
        dx, dy = (landmark - pose[:, :2]).T
        c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        return np.stack([c * dx + s * dy, c * dy - s * dx], axis=-1) - measured

    type = cairn.FactorType("EDGE_SEEN", [cairn.Pose2, cairn.Point2], seen, residual_size=2, measurement_size=2)
    graph, pairs, _ = ranges()
    other = graph.copy()
    random = np.random.default_rng(0)
    root = random.normal(size=(len(pairs), 2, 2)) + 5 * np.eye(2)
    information = root @ root.transpose(0, 2, 1)
    z = random.normal(size=(len(pairs), 2))
    graph.add_factors(type, pairs, z, information)
    other.add_factors("EDGE_SE2_XY", pairs, z, information)
    assert_allclose(graph.squared_norms(), other.squared_norms(), rtol=1e-10)
    assert_allclose(cairn.optimize(graph, initial=None).chi2, cairn.optimize(other, initial=None).chi2, rtol=1e-8)


def test_poses_of_space_step_in_their_tangent_space():
    def error(pose, measured):
        return pose[:, :3] - measured

    position = cairn.FactorType("EDGE_POSITION", [cairn.Pose3], error, residual_size=3, measurement_size=3)
    pose = cairn.Pose3(cairn.Rot3.from_roll_pitch_yaw(0.3, -0.5, 2), [1, 2, 3])
    assert position.check([pose.state], [0, 0, 0]) < 1e-7
    given = cairn.FactorType(
        "EDGE_POSITION", [cairn.Pose3], error, residual_size=3, measurement_size=3,
        jacobians=lambda pose, measured: [np.array([np.c_[cairn.Pose3.from_state(x).matrix()[:3, :3], np.zeros((3, 3))] for x in pose])],
    )
    assert given.check([pose.state], [0, 0, 0]) < 1e-7


def test_all_factors_are_evaluated_in_one_call():
    calls = []

    def counted(pose, beacon, measured):
        calls.append(len(pose))
        return residual(pose, beacon, measured)

    graph, pairs, z = ranges(poses=900)
    graph.add_factors(distance(residual=counted), pairs, z, sigmas=0.1)
    graph.chi2()
    assert calls == [len(pairs)]
    graph.squared_norms()
    assert calls == [len(pairs)]  # nothing has changed
    graph.set_states(cairn.Point2, graph.states(cairn.Point2) + 1)
    chi2 = graph.chi2()
    assert calls == [len(pairs)] * 2
    graph.set_states(cairn.Point2, graph.states(cairn.Point2) - 0.5)
    assert graph.chi2() != chi2


def test_a_wrong_jacobian_is_reported():
    def wrong(pose, beacon, measured):
        of_pose, of_beacon = jacobians(pose, beacon, measured)
        return of_pose, -of_beacon

    type = distance(jacobians=wrong)
    assert type.check([[1, 2, 0.3], [4, 6]], [4.5]) > 0.1
    assert distance(jacobians=jacobians).check([[1, 2, 0.3], [4, 6]], [4.5]) < 1e-7
    graph, pairs, z = ranges()
    graph.add_factors(type, pairs, z, sigmas=0.1)
    notes = cairn.optimize(graph, initial=None).notes
    assert any("EDGE_DISTANCE" in note and "Jacobian" in note for note in notes), notes


@pytest.mark.parametrize(
    "function, given, message",
    [
        (lambda pose, beacon, measured: pose + beacon, None, r"'EDGE_DISTANCE', written in Python: ValueError: .*test_factor_types.py, line \d+"),
        (lambda pose, beacon, measured: pose, None, r"what residual returned has the shape \(90, 3\), expected \(90, 1\)"),
        (lambda pose, beacon, measured: None, None, "what residual returned"),
        (lambda pose, beacon, measured: "x", None, "what residual returned: expected numbers"),
        (residual, lambda *x: [np.zeros((len(x[0]), 1, 3))], "one array for each of its 2 variables"),
        (residual, lambda *x: jacobians(*x)[::-1], r"Jacobian 0 has the shape \(90, 1, 2\), expected \(90, 1, 3\)"),
    ],
)
def test_what_goes_wrong_in_a_function_is_an_error(function, given, message):
    graph, pairs, z = ranges()
    graph.add_factors(distance(residual=function, jacobians=given), pairs, z, sigmas=0.1)
    with pytest.raises(cairn.Error, match=message):
        cairn.optimize(graph, initial=None)
    assert graph.variable_count == 63  # and the graph can still be used


def test_one_number_needs_no_dimension_of_its_own():
    graph, pairs, z = ranges()
    flat = graph.copy()
    graph.add_factors(distance(), pairs, z, sigmas=0.1)
    flat.add_factors(distance(residual=lambda *x: residual(*x)[:, 0]), pairs, z, sigmas=0.1)
    assert flat.chi2() == graph.chi2()


def test_a_type_that_makes_no_sense_is_refused():
    for arguments, message in [
        (dict(tag=""), "needs a tag"),
        (dict(variables=[]), "needs the types of its variables"),
        (dict(variables=["VERTEX_SE4"]), "VERTEX_SE4"),
        (dict(residual_size=0), "at least one number"),
        (dict(residual=3), "residual and jacobians are functions"),
    ]:
        all = dict(dict(tag="EDGE_X", variables=[cairn.Pose2], residual=residual, residual_size=1, measurement_size=1), **arguments)
        with pytest.raises(cairn.Error, match=message):
            cairn.FactorType(all.pop("tag"), all.pop("variables"), all.pop("residual"), **all)
    with pytest.raises(cairn.Error, match=r"states\[1\]: 3 numbers, expected 2"):
        distance().check([[0, 0, 0], [0, 0, 0]], [1])


def test_graphs_outlive_the_names_of_their_types_and_threads_solve_at_once():
    graphs = []
    for _ in range(3):
        graph, pairs, z = ranges()
        graph.add_factors(distance(), pairs, z, sigmas=0.1)
        graphs.append(graph)
    shared = distance()
    for _ in range(3):  # of one type, with different states
        graph, pairs, z = ranges(seed=len(graphs))
        graph.add_factors(shared, pairs, z, sigmas=0.1)
        graphs.append(graph)
    gc.collect()
    expected = [cairn.optimize(graph.copy(), initial=None).chi2 for graph in graphs]
    results = [None] * len(graphs)

    def solve(k):
        results[k] = cairn.optimize(graphs[k], initial=None).chi2

    threads = [threading.Thread(target=solve, args=[k]) for k in range(len(graphs))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == expected


def test_a_registered_type_is_read_from_files(tmp_path):
    # In a process of its own: what is registered stays so.
    program = """
import sys
sys.path.insert(0, sys.argv[1])
import cairn
from test_factor_types import distance, ranges
graph, pairs, z = ranges()
graph.add_factors(distance(), pairs, z, sigmas=0.1)
graph.write("map.g2o")
try:
    cairn.read("map.g2o")
except cairn.Error as error:
    assert "EDGE_DISTANCE" in str(error), error
cairn.register(distance(), "distance of a beacon [m]")
again = cairn.read("map.g2o")
assert again.factor_types == graph.factor_types
assert abs(again.chi2() / graph.chi2() - 1) < 1e-9
assert cairn.components("factor")["EDGE_DISTANCE"].summary == "distance of a beacon [m]"
try:
    cairn.register(distance())
except cairn.Error as error:
    print(error)
"""
    ended = subprocess.run([sys.executable, "-c", program, __file__.rsplit("/", 1)[0]], cwd=tmp_path, capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")  # the registry, too, ends without the interpreter
    assert "EDGE_DISTANCE" in ended.stdout


def test_ctrl_c_in_a_function_keeps_the_best_estimate():
    program = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.path.insert(0, sys.argv[1])
import cairn
from test_factor_types import distance, ranges, residual
calls = []
def pressed(*x):
    calls.append(1)
    if len(calls) == 20:
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000): pass
    return residual(*x)
graph, pairs, z = ranges()
graph.add_factors(distance(residual=pressed), pairs, z, sigmas=0.1)
cairn.set_threads(1)
summary = cairn.optimize(graph, initial=None, tolerance=0, max_iterations=10**6)
print(summary.status)
"""
    ended = subprocess.run([sys.executable, "-c", program, __file__.rsplit("/", 1)[0]], capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout) == (0, "interrupted\n"), ended.stderr


def bearings(wrapped):
    """A robot that drives a circle and sees three landmarks; only where the error is wrapped is it right everywhere."""

    def residual(pose, landmark, measured):
        dx, dy = (landmark - pose[:, :2]).T
        error = (np.arctan2(dy, dx) - pose[:, 2])[:, None] - measured
        return (error + np.pi) % (2 * np.pi) - np.pi if wrapped else error

    direction = cairn.FactorType("EDGE_DIRECTION", [cairn.Pose2, cairn.Point2], residual, residual_size=1, measurement_size=1)
    angles = np.arange(40) * 2 * np.pi / 40
    poses = np.column_stack([20 * np.cos(angles), 20 * np.sin(angles), (angles + 1.5 * np.pi) % (2 * np.pi) - np.pi])
    landmarks = np.array([[-30.0, -30.0], [30.0, -30.0], [-30.0, 30.0]])
    graph = cairn.Graph()
    graph.add_variables(cairn.Pose2, np.arange(40), poses)
    graph.add_variables(cairn.Point2, [100, 101, 102], landmarks + 0.5)
    graph.fix([0])
    pairs = np.array([[k, 100 + b] for k in range(40) for b in range(3)])
    offset = landmarks[pairs[:, 1] - 100] - poses[pairs[:, 0], :2]
    seen = np.arctan2(offset[:, 1], offset[:, 0]) - poses[pairs[:, 0], 2]
    graph.add_factors(direction, pairs, (seen + np.pi) % (2 * np.pi) - np.pi, sigmas=0.01)
    steps = [cairn.Pose2(*poses[k]).between(cairn.Pose2(*poses[k + 1])).state for k in range(39)]
    graph.add_factors("EDGE_SE2", np.column_stack([np.arange(39), np.arange(1, 40)]), steps, sigmas=[0.1, 0.1, 0.05])
    return graph, landmarks


def direction(error, wrapped=False, variables=(cairn.Pose2, cairn.Point2), measurement_size=1, jacobians=None):
    """A factor whose error is an angle, wrapped or not."""

    def residual(*arguments):
        e = error(*arguments)
        return (e + np.pi) % (2 * np.pi) - np.pi if wrapped else e

    return cairn.FactorType("EDGE_DIRECTION", list(variables), residual, residual_size=1, measurement_size=measurement_size, jacobians=jacobians)


def seen_from(pose, landmark, measured):
    dx, dy = (landmark - pose[:, :2]).T
    return (np.arctan2(dy, dx) - pose[:, 2])[:, None] - measured


def seen_in_frame(pose, landmark, measured):
    """As before, but that the angle of the landmark in the robot's frame is wrapped by arctan2: alone what was measured may take it beyond."""
    dx, dy = (landmark - pose[:, :2]).T
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    return np.arctan2(c * dy - s * dx, c * dx + s * dy)[:, None] - measured


def between_points(first, second, measured):
    dx, dy = (second - first).T
    return np.arctan2(dy, dx)[:, None] - measured


ANGLES = {
    "bearing": (seen_from, (cairn.Pose2, cairn.Point2), [[0, 0, 0], [1, 0]], [0]),
    "bearing, anywhere": (seen_from, (cairn.Pose2, cairn.Point2), [[1, 2, 0.3], [4, 6]], [0.2]),
    "bearing, far away": (seen_from, (cairn.Pose2, cairn.Point2), [[4e5, 5e6, 0.3], [4e5 + 3, 5e6 - 4]], [0.2]),
    "in the robot's frame": (seen_in_frame, (cairn.Pose2, cairn.Point2), [[0, 0, 0], [1, 0]], [0.1]),
    "compass": (lambda pose, measured: pose[:, 2:] - measured, (cairn.Pose2,), [[0, 0, 0]], [0]),
    "headings": (lambda a, b, measured: (b - a)[:, 2:] - measured, (cairn.Pose2, cairn.Pose2), [[0, 0, 0], [1, 0, 0]], [0]),
    "line of two points": (between_points, (cairn.Point2, cairn.Point2), [[0, 0], [3, 1]], [0.2]),
    "yaw in space": (lambda pose, measured: np.array([[cairn.Pose3.from_state(x).rotation.roll_pitch_yaw[2]] for x in pose]) - measured, (cairn.Pose3,), [[1, 2, 3, 0, 0, 0, 1]], [0.3]),
}


@pytest.mark.parametrize("name", ANGLES)
def test_a_check_finds_an_angle_that_is_not_wrapped(name):
    error, variables, states, measured = ANGLES[name]
    with pytest.raises(cairn.Error, match=r"'EDGE_DIRECTION': an error that is an angle is not wrapped .* row 0 (jumps|is) "):
        direction(error, variables=variables).check(states, measured)
    # Differences of coordinates of 5e6 have rounding errors of 1e-9.
    deviation = 1e-4 if name == "bearing, far away" else 1e-6
    assert direction(error, wrapped=True, variables=variables).check(states, measured) < deviation


@pytest.mark.parametrize("by_signal", [False, True])
@pytest.mark.parametrize("at", [1, 500, 8000])
def test_ctrl_c_ends_a_check(at, by_signal):
    calls = 0

    def residual(a, b, measured):
        nonlocal calls
        calls += 1
        if calls == at:
            if not by_signal:
                raise KeyboardInterrupt
            signal.raise_signal(signal.SIGINT)
        return b - a - measured

    type = cairn.FactorType("OFFSET", [cairn.Point2] * 2, residual, residual_size=2, measurement_size=2)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            type.check([[0, 0], [1, 1]], [1, 1])
    finally:
        signal.signal(signal.SIGINT, handler)
    assert calls == at


def test_what_is_no_exception_passes_through_a_check():
    def residual(a, b, measured):
        raise SystemExit(7)

    type = cairn.FactorType("OFFSET", [cairn.Point2] * 2, residual, residual_size=2, measurement_size=2)
    with pytest.raises(SystemExit):
        type.check([[0, 0], [1, 1]], [1, 1])


def test_a_check_accepts_what_jumps_otherwise_and_what_is_not_defined_everywhere():
    states, measured = [[1, 2, 0.3], [4, 6]], [0.2]

    def kinked(pose, landmark, measured):
        """Jumps by one where a landmark passes behind the robot, and is steep."""
        return 3 * np.sign(np.sin(pose[:, 2]))[:, None] + np.arctan(1e6 * (landmark - pose[:, :2]))[:, :1] - measured

    def ahead(pose, landmark, measured):
        """Only for landmarks ahead of the robot."""
        error = seen_in_frame(pose, landmark, measured)
        if (np.abs(error + measured) > 1.5).any():
            raise ValueError("the landmark is behind")
        return error

    for error in [kinked, ahead]:
        direction(error).check(states, measured)
    given = direction(seen_from, wrapped=True, jacobians=lambda *arguments: [np.zeros((1, 1, 3)), np.zeros((1, 1, 2))])
    assert given.check(states, measured) > 0.1  # its Jacobians are wrong, and that alone


def test_an_angle_that_is_not_wrapped_is_noted():
    graph, landmarks = bearings(wrapped=True)
    summary = cairn.optimize(graph, initial=None)
    assert summary.converged and not any("angle" in note for note in summary.notes)
    assert_allclose(graph.states(cairn.Point2), landmarks, atol=1e-6)
    graph, _ = bearings(wrapped=False)
    notes = cairn.optimize(graph, initial=None, max_iterations=3).notes
    assert any("EDGE_DIRECTION" in note and "is an angle of" in note for note in notes), notes


def test_a_tag_of_a_plugin_is_refused():
    with pytest.raises(cairn.Error, match="'EDGE_SE2' is a factor type of the plugin 'slam2d' already: give yours a tag of its own"):
        cairn.FactorType("EDGE_SE2", [cairn.Pose2, cairn.Pose2], residual, residual_size=3, measurement_size=3)
    graph = cairn.Graph()
    graph.add(0, cairn.Pose2())
    graph.add(cairn.Prior(0, cairn.Pose2()), sigmas=1)
