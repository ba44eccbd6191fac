# SPDX-License-Identifier: BSD-3-Clause
import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
import dense


def expm(A):
    """The exponential of a small matrix, by its series."""
    term, total = np.eye(len(A)), np.eye(len(A))
    for k in range(1, 40):
        term = term @ A / k
        total = total + term
    return total


def hat3(delta):
    x, y, z = delta[3:]
    A = np.zeros((4, 4))
    A[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    A[:3, 3] = delta[:3]
    return A


def hat2(delta):
    A = np.zeros((3, 3))
    A[:2, :2] = [[0, -delta[2]], [delta[2], 0]]
    A[:2, 2] = delta[:2]
    return A


def some_pose3(seed):
    return cairn.Pose3.exp(np.random.default_rng(seed).normal(size=6))


def test_planar_poses_compose_as_matrices_do():
    a, b = cairn.Pose2(1, 2, 0.5), cairn.Pose2(-3, 0.5, 2.9)
    assert_allclose((a * b).matrix(), a.matrix() @ b.matrix(), atol=1e-14)
    assert_allclose(a.inverse().matrix(), np.linalg.inv(a.matrix()), atol=1e-14)
    assert_allclose(a.between(b).matrix(), np.linalg.inv(a.matrix()) @ b.matrix(), atol=1e-14)
    assert_allclose((a * b).state, dense.compose(a.state, b.state), atol=1e-14)


def test_spatial_poses_compose_as_matrices_do():
    a, b = some_pose3(1), some_pose3(2)
    assert_allclose((a * b).matrix(), a.matrix() @ b.matrix(), atol=1e-14)
    assert_allclose(a.inverse().matrix(), np.linalg.inv(a.matrix()), atol=1e-14)
    assert cairn.Pose3.from_matrix(a.matrix()).equals(a)
    assert cairn.Pose3(a.rotation, a.translation).equals(a)


def test_exp_is_the_exponential_of_the_matrix():
    delta = np.array([0.3, -0.2, 0.9, 0.4, -1.1, 0.2])
    assert_allclose(cairn.Pose3.exp(delta).matrix(), expm(hat3(delta)), atol=1e-13)
    assert_allclose(cairn.Pose3.exp(delta).log(), delta, atol=1e-13)
    assert_allclose(cairn.Pose2.exp(delta[:3]).matrix(), expm(hat2(delta[:3])), atol=1e-13)


def test_the_adjoint_takes_a_step_to_the_other_side():
    for pose, delta in [(some_pose3(3), np.full(6, 1e-3)), (cairn.Pose2(1, 2, 3), np.full(3, 1e-3))]:
        left = pose * type(pose).exp(delta) * pose.inverse()
        assert left.equals(type(pose).exp(pose.adjoint() @ delta), 1e-12)


def test_retract_and_local_are_inverse():
    a, b = some_pose3(4), some_pose3(5)
    assert a.retract(a.local(b)).equals(b)


def test_rotations_come_in_all_forms():
    R = cairn.Rot3.from_roll_pitch_yaw(0.1, -0.4, 2.0)
    assert_allclose(R.roll_pitch_yaw, [0.1, -0.4, 2.0], atol=1e-14)
    assert cairn.Rot3.from_matrix(R.matrix()).equals(R)
    assert cairn.Rot3.from_quaternion(*R.quaternion).equals(R)
    yaw = cairn.Rot3.from_roll_pitch_yaw(0, 0, 2.0)
    assert_allclose(yaw.matrix()[:2, :2], dense.rotation(2.0), atol=1e-14)


def test_a_rotation_turns_a_point():
    R = cairn.Rot3.from_roll_pitch_yaw(0.1, -0.4, 2.0)
    turned = R * cairn.Point3(1, 2, 3)
    assert isinstance(turned, cairn.Point3)
    assert_allclose(turned.state, R.matrix() @ [1, 2, 3], atol=1e-14)


def test_points_are_transformed_one_by_one_and_in_rows():
    pose = some_pose3(6)
    points = np.random.default_rng(0).normal(size=(5, 3))
    moved = pose.transform_from(points)
    assert_allclose(moved, points @ pose.matrix()[:3, :3].T + pose.translation, atol=1e-14)
    assert_allclose(pose.transform_to(moved), points, atol=1e-14)
    assert_allclose(pose.transform_from(points[0]), moved[0])
    assert_allclose((pose * cairn.Point3(*points[0])).state, moved[0], atol=1e-15)
    with pytest.raises(cairn.Error, match=r"points: the shape is \(5, 2\), expected \(3,\) or \(n, 3\)"):
        pose.transform_from(points[:, :2])


def test_values_print_copy_and_pickle():
    for value in [cairn.Pose2(1, 2, 0.5), some_pose3(7), cairn.Point2(1, 2), cairn.Point3(1, 2, 3), some_pose3(8).rotation]:
        for other in [copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))]:
            assert type(other) is type(value)
            assert_allclose(other.state, value.state, atol=0)
        assert repr(value).startswith(type(value).__name__ + "(")
        assert_allclose(np.asarray(value), value.state)
    assert repr(cairn.Pose2(1, 2, 0.5)) == "Pose2(1, 2, 0.5)"


def test_a_state_of_another_size_is_refused():
    with pytest.raises(cairn.Error, match="a Pose2 is stored as 3 numbers, not 2"):
        cairn.Pose2.from_state([1, 2])


def test_symbols_are_ids():
    assert cairn.X(3) == cairn.symbol("x", 3)
    assert cairn.id_text(cairn.L(12)) == "l12"
    assert cairn.id_text(12) == "12"
    with pytest.raises(cairn.Error, match="a symbol is one letter"):
        cairn.symbol("xy", 1)


def test_values_are_equal_where_all_their_numbers_are():
    makers = [lambda: cairn.Pose2(1, 2, 3), lambda: some_pose3(7), lambda: cairn.Point2(1, 2), lambda: cairn.Point3(1, 2, 3), lambda: some_pose3(8).rotation]
    for make in makers:
        value = make()
        assert value == make() and not value != make()
        assert hash(value) == hash(make()) and {value: 1}[make()] == 1
        assert value in [make()]
        assert value != type(value)() and value != "text" and value is not None
    assert cairn.Pose2(1, 2, 3) != cairn.Pose2(1, 2, np.nextafter(3, 4))
    assert cairn.Point2(1, 2) != cairn.Pose2(1, 2, 0)
