# SPDX-License-Identifier: BSD-3-Clause
"""ROS's conventions against differences and samples in plain NumPy; no ROS is needed."""
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cairn import Pose2, Pose3, Rot3
from cairn_ros import conventions


def message(x, y, z, qx, qy, qz, qw):
    return SimpleNamespace(position=SimpleNamespace(x=x, y=y, z=z), orientation=SimpleNamespace(x=qx, y=qy, z=qz, w=qw))


def empty():
    return message(*[np.nan] * 7)


def matrix(axis, angle):
    """Rodrigues' formula, by NumPy alone."""
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def rpy(roll, pitch, yaw):
    return matrix([0, 0, 1], yaw) @ matrix([0, 1, 0], pitch) @ matrix([1, 0, 0], roll)


ANGLES = np.array([0.4, -0.7, 2.1])
POSE = Pose3(Rot3.from_matrix(rpy(*ANGLES)), [1.0, -2.0, 0.5])


def with_errors(e, angles):
    """The pose of which POSE is the measurement with ROS's six errors e."""
    if angles == "roll_pitch_yaw":
        R = rpy(*(ANGLES + e[3:]))
    else:
        angle = np.linalg.norm(e[3:])
        R = matrix(e[3:] / angle if angle > 0 else [1, 0, 0], angle) @ POSE.rotation.matrix()
    return Pose3(Rot3.from_matrix(R), POSE.translation + e[:3])


def covariance(seed=1, scale=0.1):
    root = np.random.default_rng(seed).normal(size=(6, 6)) * scale
    return root @ root.T + 1e-4 * np.eye(6)


@pytest.mark.parametrize("angles", conventions.ANGLES)
def test_the_step_of_errors_is_the_derivative(angles):
    columns = [(POSE.local(with_errors(h, angles)) - POSE.local(with_errors(-h, angles))) / 2e-6 for h in np.eye(6) * 1e-6]
    assert_allclose(conventions.step_of_errors(POSE, angles), np.column_stack(columns), atol=1e-8)


def test_the_two_readings_of_angles_differ_where_the_robot_is_tilted():
    sigma = covariance()
    a, b = (conventions.step_covariance(POSE, sigma.ravel(), angles) for angles in conventions.ANGLES)
    assert np.abs(a - b).max() > 1e-3


def test_the_covariance_is_that_of_samples():
    sigma = covariance(scale=0.01)
    random = np.random.default_rng(3)
    errors = random.multivariate_normal(np.zeros(6), sigma, 3_000)
    steps = np.array([POSE.local(with_errors(e, "fixed_axes")) for e in errors])
    assert_allclose(conventions.step_covariance(POSE, sigma.ravel()), np.cov(steps.T), atol=0.1 * sigma.max())


def test_covariances_come_back_as_they_were():
    sigma = covariance()
    assert_allclose(conventions.message_covariance(POSE, conventions.step_covariance(POSE, sigma.ravel())), sigma.ravel(), atol=1e-12)


def test_planar_poses_have_x_y_and_yaw():
    pose, h = Pose2(3.0, 1.0, 2.5), 1e-6
    A = conventions.step_of_errors(pose)
    for k, e in enumerate(np.eye(3) * h):
        assert_allclose(A[:, k], pose.local(Pose2(pose.x + e[0], pose.y + e[1], pose.theta + e[2])) / h, atol=1e-5)
    sigma = covariance()
    planar = conventions.step_covariance(pose, sigma.ravel())
    assert_allclose(planar, A @ sigma[np.ix_([0, 1, 5], [0, 1, 5])] @ A.T)
    back = np.reshape(conventions.message_covariance(pose, planar), (6, 6))
    assert_allclose(back[np.ix_([0, 1, 5], [0, 1, 5])], sigma[np.ix_([0, 1, 5], [0, 1, 5])], atol=1e-12)
    assert not back[2:5].any() and not back[:, 2:5].any()


def test_poses_come_back_as_they_were():
    for pose in [POSE, Pose2(3.0, 1.0, 2.5)]:
        back = conventions.pose3(conventions.write_pose(pose, empty()))
        assert back.equals(conventions.spatial(pose), 1e-12)
    assert conventions.planar(conventions.spatial(Pose2(3.0, 1.0, 2.5))).equals(Pose2(3.0, 1.0, 2.5), 1e-12)
    transform = SimpleNamespace(translation=SimpleNamespace(), rotation=SimpleNamespace())
    conventions.write_pose(Pose2(3.0, 1.0, np.pi / 2), transform)
    assert_allclose([transform.translation.x, transform.translation.y, transform.translation.z], [3, 1, 0])
    assert_allclose([transform.rotation.x, transform.rotation.y, transform.rotation.z, transform.rotation.w], [0, 0, 0.5**0.5, 0.5**0.5])


@pytest.mark.parametrize(
    "numbers, words", [((0, 0, 0, 0, 0, 0, 0), "unit quaternion"), ((0, np.inf, 0, 0, 0, 0, 1), "not finite"), ((0, 0, 0, 0, 0, 0, 0.5), "0.5")]
)
def test_poses_that_are_none_are_refused(numbers, words):
    with pytest.raises(ValueError, match=words):
        conventions.pose3(message(*numbers))


def test_covariances_that_are_none_are_refused():
    with pytest.raises(ValueError, match="not taken for 'unknown'"):
        conventions.step_covariance(POSE, [0.0] * 36)
    with pytest.raises(ValueError, match="x, y and the rotation about Z is not positive definite"):
        conventions.step_covariance(Pose2(), np.diag([1.0, -1.0, 1.0, 1.0, 1.0, 1.0]).ravel())
    with pytest.raises(ValueError, match="finite and symmetric"):
        conventions.step_covariance(POSE, np.triu(np.ones((6, 6))).ravel())
    assert not conventions.step_covariance(POSE, [0.0] * 36, semidefinite=True).any()
    rounded = np.diag([0.01] * 6)
    rounded[0, 1], rounded[1, 0] = 1e-19, -2e-19  # as filters leave it
    assert np.allclose(conventions.step_covariance(POSE, rounded.ravel()), conventions.step_covariance(POSE, np.diag([0.01] * 6).ravel()))
    only_z = np.diag([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])  # as planar robots send it
    assert_allclose(conventions.step_covariance(Pose2(0.0, 0.0, 0.3), only_z.ravel()), np.eye(3), atol=1e-15)


def test_frames_carry_a_time_to_the_nanosecond():
    stamp = 1_700_000_000_123_456_789
    assert conventions.frame_at("base_link", stamp) == "base_link@1700000000.123456789"
    assert conventions.split_frame("base_link@1700000000.123456789") == ("base_link", stamp)
    assert conventions.split_frame("/robot/base@12.5") == ("robot/base", 12_500_000_000)
    assert conventions.split_frame("map") == ("map", None)
    for name in ["base_link@", "base_link@now", "base_link@-1", "base_link@1.0000000001"]:
        with pytest.raises(ValueError, match="does not end in a time"):
            conventions.split_frame(name)
