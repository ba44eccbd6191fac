# SPDX-License-Identifier: BSD-3-Clause
"""What odometry says: the pose in its frame at any time, and how certain a motion is."""
from array import array
from bisect import bisect_left

import numpy as np

from cairn import Pose2


class Odometry:
    """The poses of a robot in the frame of its odometry, by time [ns]; 64 bytes for each in space."""

    def __init__(self, pose_type):
        self._type = pose_type
        self._size = len(pose_type().state)
        self._stamps = array("q")
        self._states = array("d")

    def add(self, stamp, pose):
        """False where `stamp` is not later than the last one: nothing is added."""
        if self._stamps and stamp <= self._stamps[-1]:
            return False
        self._stamps.append(stamp)
        self._states.extend(pose.state)
        return True

    @property
    def span(self):
        """First and last time, or None."""
        return (self._stamps[0], self._stamps[-1]) if self._stamps else None

    def at(self, stamp):
        """The pose at a time within the span, between two messages by a motion of constant velocity: a exp(s log(a^-1 b))."""
        k = bisect_left(self._stamps, stamp)
        if self._stamps[k] == stamp:
            return self._pose(k)
        a, b = self._pose(k - 1), self._pose(k)
        part = (stamp - self._stamps[k - 1]) / (self._stamps[k] - self._stamps[k - 1])
        return a * self._type.exp(part * a.between(b).log())

    def _pose(self, k):
        return self._type.from_state(self._states[k * self._size : (k + 1) * self._size])


class MotionNoise:
    """Errors of odometry as a random walk: variances grow with the distance and with the angle turned, so that they do not
    depend on how a motion is divided. translation [m per sqrt(m)], rotation [rad per sqrt(m)], turn [rad per sqrt(rad)]."""

    least = 1e-3  # m, rad: no motion is without error

    def __init__(self, translation=0.05, rotation=0.02, turn=0.05):
        for name, value in [("translation", translation), ("rotation", rotation), ("turn", turn)]:
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"the noise of {name} is {value}; it must be 0 or more")
        self.translation, self.rotation, self.turn = translation, rotation, turn

    def covariance(self, motion):
        """Of the step delta in the frame at the motion's end."""
        d = 2 if isinstance(motion, Pose2) else 3
        distance = np.linalg.norm(motion.translation)
        angle = np.linalg.norm(motion.log()[d:])
        variances = np.full(3 if d == 2 else 6, self.least**2 + self.translation**2 * distance)
        variances[d:] = self.least**2 + self.rotation**2 * distance + self.turn**2 * angle
        return np.diag(variances)


def motion_covariance(motion, before, after):
    """Covariance of a motion between two poses whose own covariances, both from the start, are `before` and `after`:
    Q = after - Ad(Z^-1) before Ad(Z^-1)^T. None where that is not positive definite: they do not accumulate."""
    A = motion.inverse().adjoint()
    Q = after - A @ before @ A.T
    Q = (Q + Q.T) / 2
    return Q if np.linalg.eigvalsh(Q)[0] > 1e-9 * np.linalg.eigvalsh(after)[-1] else None
