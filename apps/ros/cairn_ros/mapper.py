# SPDX-License-Identifier: BSD-3-Clause
"""The pose graph of a robot that drives: odometry, loop closures and absolute poses come by their times; no ROS is needed."""
from bisect import bisect_left
from collections import deque

import numpy as np

import cairn
from cairn import Between, Pose2, Pose3, Prior

from .odometry import MotionNoise, Odometry, motion_covariance

MOST_WAITING = 1000


class Mapper:
    """Keyframes along the odometry, and the estimator that has them as variables 0, 1, 2, ….

    estimator: the name of an estimator, with options. planar: poses are `Pose2`, otherwise `Pose3`. A keyframe is made where
    odometry has moved by keyframe_distance [m] or turned by keyframe_angle [rad] since the last one. loss: a robust loss for
    what is not odometry. Times are in nanoseconds.

    The first keyframe is where odometry has it, so that both frames agree at the start; until an absolute pose comes, the
    estimator anchors it.
    """

    def __init__(self, estimator="incremental_cholesky", *, planar=True, keyframe_distance=0.5, keyframe_angle=0.5, noise=None, loss=None):
        if not (keyframe_distance > 0 and keyframe_angle > 0):
            raise ValueError("keyframe_distance and keyframe_angle must be above 0")
        self.pose_type = Pose2 if planar else Pose3
        self.estimator = cairn.Estimator(estimator)
        self.stamps = []  # of the keyframes
        self.links = []  # pairs of keyframes, of loop closures
        self.notes = []  # what the user should know; whoever shows them empties it
        self._distance, self._angle = keyframe_distance, keyframe_angle
        self._noise = noise or MotionNoise()
        self._loss = loss
        self._odometry = Odometry(self.pose_type)
        self._last = None  # odometry at the last keyframe: pose, covariance
        self._waiting = deque()
        self.map_from_odometry = self.pose_type()

    def odometry(self, stamp, pose, covariance=None):
        """A pose in the frame of odometry, and, where its errors accumulate in it, its covariance. True: a keyframe was made.
        What waited for this time is carried out."""
        if not self._odometry.add(stamp, pose):
            raise ValueError(f"odometry of {stamp / 1e9:.3f} s is not later than the last one")
        made = self._is_due(pose)
        if made:
            self._add_keyframe(stamp, pose, covariance)
        for _ in range(len(self._waiting)):
            what = self._waiting.popleft()
            if what[1] > stamp:
                self._waiting.append(what)
                continue
            try:
                self._carry_out(*what)
            except (ValueError, cairn.Error) as error:
                self.notes.append(str(error))
        return made

    def loop_closure(self, earlier, later, measured, covariance):
        """The pose at `later` as seen from that at `earlier`, with its covariance (of the step). False: it waits for odometry."""
        return self._take(min(earlier, later), max(earlier, later), (earlier, later), measured, covariance)

    def absolute(self, stamp, measured, covariance):
        """The pose at `stamp` in the frame of the map. False: it waits for odometry."""
        return self._take(stamp, stamp, (stamp,), measured, covariance)

    def trajectory(self):
        """The estimates of all keyframes: (n, 3) x y theta, or (n, 7) x y z qx qy qz qw."""
        return self.estimator.states(self.pose_type)

    # ---- keyframes

    def _is_due(self, pose):
        if self._last is None:
            return True
        motion = self._last[0].between(pose)
        d = 2 if self.pose_type is Pose2 else 3
        return np.linalg.norm(motion.translation) >= self._distance or np.linalg.norm(motion.log()[d:]) >= self._angle

    def _add_keyframe(self, stamp, pose, covariance):
        id = len(self.stamps)
        if id == 0:
            self.estimator.add(id, pose)
        else:
            motion = self._last[0].between(pose)
            sigma = None
            if covariance is not None and self._last[1] is not None:
                sigma = motion_covariance(motion, self._last[1], covariance)
            if sigma is None:
                sigma = self._noise.covariance(motion)
            self.estimator.add(id, self.pose_type)
            self.estimator.add(Between(id - 1, id, motion), covariance=sigma)
        self.notes += self.estimator.update().notes
        self.stamps.append(stamp)
        self._last = (pose, covariance)
        self._correct()

    def _correct(self):
        self.map_from_odometry = self.estimator.estimate(len(self.stamps) - 1) * self._last[0].inverse()

    # ---- measurements

    def _take(self, first, last, *what):
        span = self._odometry.span
        if span and first < span[0]:
            raise ValueError(f"a measurement of {first / 1e9:.3f} s is older than all odometry, which begins at {span[0] / 1e9:.3f} s")
        if not span or last > span[1]:
            if len(self._waiting) == MOST_WAITING:
                raise ValueError(f"{MOST_WAITING} measurements wait for odometry of their times")
            self._waiting.append((first, last, *what))
            return False
        self._carry_out(first, last, *what)
        return True

    def _carry_out(self, first, last, stamps, measured, covariance):
        if first < self._odometry.span[0]:
            raise ValueError(f"a measurement of {first / 1e9:.3f} s is older than all odometry")
        ends = [self._keyframe_near(stamp) for stamp in stamps]
        (b, to_b), (a, to_a) = ends[-1], ends[0]
        if len(ends) == 2 and a == b:
            raise ValueError(f"both times of a loop closure belong to keyframe {a}")
        # X_a A exp(alpha) Z exp(zeta) = X_b B exp(beta), so that A Z B^-1 is measured with the error
        # Ad(B) (zeta - beta) + Ad(B Z^-1) alpha.
        sigma = np.array(covariance, dtype=float)
        if to_b is not None:
            sigma = to_b.adjoint() @ (sigma + self._noise.covariance(to_b)) @ to_b.adjoint().T
        value = measured if to_b is None else measured * to_b.inverse()
        if len(ends) == 2:
            if to_a is not None:
                A = value.inverse().adjoint()
                sigma = sigma + A @ self._noise.covariance(to_a) @ A.T
                value = to_a * value
            factor = cairn.Factor(Between(a, b, value), covariance=(sigma + sigma.T) / 2, loss=self._loss)
        else:
            factor = cairn.Factor(Prior(b, value), covariance=(sigma + sigma.T) / 2, loss=self._loss)
        self.estimator.add(factor)
        self.notes += self.estimator.update().notes
        if len(ends) == 2:
            self.links.append((a, b))
        self._correct()

    def _keyframe_near(self, stamp):
        """The keyframe that is nearest in time, and the motion from there; None for none."""
        k = bisect_left(self.stamps, stamp)
        if k == len(self.stamps) or (k > 0 and stamp - self.stamps[k - 1] < self.stamps[k] - stamp):
            k -= 1
        if self.stamps[k] == stamp:
            return k, None
        return k, self._odometry.at(self.stamps[k]).between(self._odometry.at(stamp))
