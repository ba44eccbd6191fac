# SPDX-License-Identifier: BSD-3-Clause
"""Poses, covariances and frame names, from ROS messages to cairn and back.

`geometry_msgs/PoseWithCovariance` has the covariance of (x, y, z, rotation about X, about Y, about Z), whose axes are those of the
frame in which the pose is given: t_true = t + dt, R_true = exp(dtheta) R. cairn's covariances are those of the step delta in the
frame of the pose itself, x_true = x * exp(delta), translation first. To first order delta = (R^T dt, R^T dtheta).
"""
import numpy as np

from cairn import Pose2, Pose3, Rot3

PLANAR = [0, 1, 5]  # x, y and the rotation about Z among ROS's six
ANGLES = ("fixed_axes", "roll_pitch_yaw")


def pose3(message):
    """The `Pose3` of a geometry_msgs/Pose. ValueError where it has numbers that are not finite or no unit quaternion."""
    p, q = message.position, message.orientation
    state = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    if not np.isfinite(state).all():
        raise ValueError("the pose has numbers that are not finite")
    norm = np.linalg.norm(state[3:])
    if abs(norm - 1) > 1e-2:
        raise ValueError(f"the orientation is no unit quaternion: its norm is {norm:.3g}")
    return Pose3(Rot3.from_quaternion(*(state[3:] / norm)), state[:3])


def planar(pose):
    """x, y and yaw of a `Pose3`."""
    return Pose2(pose.x, pose.y, pose.rotation.roll_pitch_yaw[2])


def spatial(pose):
    """The `Pose3` of a pose in the plane or in space."""
    if isinstance(pose, Pose3):
        return pose
    return Pose3(Rot3.from_roll_pitch_yaw(0, 0, pose.theta), [pose.x, pose.y, 0.0])


def write_pose(pose, message):
    """Fills a geometry_msgs/Pose, or the translation and rotation of a geometry_msgs/Transform."""
    state = spatial(pose).state
    is_transform = hasattr(message, "translation")
    position, orientation = (message.translation, message.rotation) if is_transform else (message.position, message.orientation)
    position.x, position.y, position.z = map(float, state[:3])
    orientation.x, orientation.y, orientation.z, orientation.w = map(float, state[3:])
    return message


def step_of_errors(pose, angles="fixed_axes"):
    """The matrix A with delta = A e to first order, e being ROS's six errors (the three planar ones for a `Pose2`).

    angles: what ROS's three angles are errors of: rotations about the fixed axes of the frame (`fixed_axes`, the words of
    geometry_msgs), or the angles of `Rz(yaw) Ry(pitch) Rx(roll)` (`roll_pitch_yaw`, as in the state of robot_localization).
    """
    if isinstance(pose, Pose2):
        A = np.eye(3)
        A[:2, :2] = pose.matrix()[:2, :2].T
        return A
    R = pose.rotation.matrix()
    A = np.zeros((6, 6))
    A[:3, :3] = R.T
    if angles == "fixed_axes":
        A[3:, 3:] = R.T
    elif angles == "roll_pitch_yaw":
        _, pitch, yaw = pose.rotation.roll_pitch_yaw
        Rz = Rot3.from_roll_pitch_yaw(0, 0, yaw).matrix()
        RzRy = Rot3.from_roll_pitch_yaw(0, pitch, yaw).matrix()
        A[3:, 3:] = R.T @ np.column_stack([RzRy[:, 0], Rz[:, 1], [0.0, 0.0, 1.0]])
    else:
        raise ValueError(f"there are no angles '{angles}' (on offer: {', '.join(ANGLES)})")
    return A


def step_covariance(pose, covariance, angles="fixed_axes", semidefinite=False):
    """cairn's covariance, (3, 3) or (6, 6), of ROS's 36 numbers. ValueError where it is not positive definite (or semidefinite)."""
    sigma = np.asarray(covariance, dtype=float).reshape(6, 6)
    names = "x, y, z, rotations about X, Y and Z"
    if isinstance(pose, Pose2):
        sigma, names = sigma[np.ix_(PLANAR, PLANAR)], "x, y and the rotation about Z"
    scale = np.sqrt(np.abs(np.diag(sigma)))
    if not np.isfinite(sigma).all() or (np.abs(sigma - sigma.T) > 1e-6 * np.outer(scale, scale)).any():
        raise ValueError("the covariance is not finite and symmetric")
    least, *_, largest = np.linalg.eigvalsh(sigma)
    if least < -1e-9 * abs(largest) if semidefinite else least <= 0:
        raise ValueError(f"the covariance of {names} is not positive definite; zeros are not taken for 'unknown'")
    A = step_of_errors(pose, angles)
    return A @ ((sigma + sigma.T) / 2) @ A.T


def message_covariance(pose, sigma):
    """ROS's 36 numbers, row by row, of cairn's covariance of a pose; 0 for what a planar pose does not have."""
    A = np.linalg.inv(step_of_errors(pose))
    rotated = A @ sigma @ A.T
    result = np.zeros((6, 6))
    rows = PLANAR if isinstance(pose, Pose2) else range(6)
    result[np.ix_(rows, rows)] = (rotated + rotated.T) / 2
    return result.ravel().tolist()


def frame_at(frame, stamp):
    """The name of the robot's frame as it was at a time [ns]: `base_link@1700000000.250000000`."""
    return f"{frame}@{stamp // 10**9}.{stamp % 10**9:09d}"


def split_frame(name):
    """Frame and time [ns] of such a name; the time is None where the name has none."""
    frame, at, time = name.lstrip("/").rpartition("@")
    if not at:
        return time, None
    seconds, _, fraction = time.partition(".")
    if not (seconds.isdigit() and (fraction.isdigit() or not fraction) and len(fraction) <= 9):
        raise ValueError(f"'{name}' does not end in a time such as @1700000000.25")
    return frame, int(seconds) * 10**9 + int(fraction.ljust(9, "0"))
