# SPDX-License-Identifier: BSD-3-Clause
"""The node as roslaunch starts it, over a master of its own: what it is sent, and what it publishes."""
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
from cairn import Pose2, Pose3, Rot3
from cairn_ros import conventions
from cairn_ros.mapper import Mapper

# rospy's own: it leaves sockets open and calls what Python has renamed.
pytestmark = [pytest.mark.filterwarnings(f"ignore::{name}") for name in ["ResourceWarning", "DeprecationWarning", "pytest.PytestUnraisableExceptionWarning"]]

SOURCE = Path(__file__).resolve().parents[2]
START = 1_700_000_000 * 10**9
SECOND = 10**9


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.fixture(scope="module")
def ros(tmp_path_factory):
    """A master, and this process as a node of it."""
    home = tmp_path_factory.mktemp("ros")
    os.environ.update(
        ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}", ROS_IP="127.0.0.1", ROS_HOME=str(home), ROS_LOG_DIR=str(home)
    )
    if (SOURCE / "apps" / "ros").exists():  # otherwise the installed one
        os.environ["ROS_PACKAGE_PATH"] = str(SOURCE / "apps" / "ros")
    port = os.environ["ROS_MASTER_URI"].rpartition(":")[2]
    master = subprocess.Popen(["roscore", "-p", port], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    import rospy

    until(lambda: answers(port), "the master")
    rospy.init_node("front_end", disable_signals=True)
    yield rospy
    rospy.signal_shutdown("the tests are over")
    master.send_signal(signal.SIGINT)
    master.wait(20)


def answers(port):
    import rosgraph

    assert port
    return rosgraph.is_master_online()


def until(holds, what, seconds=60):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"waited {seconds} s for {what}"
        time.sleep(0.02)


class Robot:
    """Sends odometry and poses to the node, and keeps what comes back."""

    def __init__(self, rospy, launch_arguments=(), base="base_link"):
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from nav_msgs.msg import Odometry, Path as PathMessage
        from tf2_msgs.msg import TFMessage
        from visualization_msgs.msg import MarkerArray

        self.rospy, self.base = rospy, base
        self.got = {name: [] for name in ["tf", "path", "pose", "markers"]}
        self.lock = threading.Lock()
        self.listeners = [
            rospy.Subscriber(topic, kind, self._keep(name))
            for name, topic, kind in [("tf", "/tf", TFMessage), ("path", "/cairn/path", PathMessage), ("pose", "/cairn/pose", PoseWithCovarianceStamped), ("markers", "/cairn/markers", MarkerArray)]
        ]
        self.types = Odometry, PoseWithCovarianceStamped
        self.odom = rospy.Publisher("/odom", Odometry, queue_size=1000)
        self.loops = rospy.Publisher("/loop_closures", PoseWithCovarianceStamped, queue_size=1000)
        self.absolute = rospy.Publisher("/absolute_poses", PoseWithCovarianceStamped, queue_size=1000)
        self.log = open(Path(os.environ["ROS_HOME"]) / "node.log", "w+")
        self.process = subprocess.Popen(["roslaunch", "cairn_ros", "cairn.launch", *launch_arguments], stdout=self.log, stderr=subprocess.STDOUT)
        publishers = [self.odom, self.loops, self.absolute]
        until(lambda: all(p.get_num_connections() for p in publishers) and all(s.get_num_connections() for s in self.listeners), "the node's topics")

    def _keep(self, name):
        def keep(message):
            with self.lock:
                self.got[name].append(message)

        return keep

    def send_odometry(self, stamp, pose, covariance=None):
        message = self.types[0]()
        message.header.stamp, message.header.frame_id, message.child_frame_id = self.rospy.Time(0, stamp), "odom", self.base
        conventions.write_pose(pose, message.pose.pose)
        if covariance is not None:
            message.pose.covariance = covariance
        self.odom.publish(message)

    def send_pose(self, publisher, frame, stamp, pose, sigma):
        message = self.types[1]()
        message.header.stamp, message.header.frame_id = self.rospy.Time(0, stamp), frame
        conventions.write_pose(pose, message.pose.pose)
        message.pose.covariance = sigma
        publisher.publish(message)

    def last(self, name):
        with self.lock:
            return self.got[name][-1] if self.got[name] else None

    def path(self):
        message = self.last("path")
        return np.array([conventions.pose3(stamped.pose).state for stamped in message.poses]) if message else np.zeros((0, 7))

    def end(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(30)
        for listener in self.listeners:
            listener.unregister()
        for publisher in [self.odom, self.loops, self.absolute]:
            publisher.unregister()
        self.log.seek(0)
        return self.log.read()


def covariance(sigmas):
    return np.diag(np.square(sigmas)).ravel().tolist()


SIGMAS = [0.02, 0.02, 0.5, 0.5, 0.5, 0.01]
lap, true_step, wrong_step = 8, Pose2(1.0, 0.0, np.pi / 4), Pose2(1.05, 0.0, np.pi / 4 + 0.01)


def test_a_drive_in_the_plane(ros, tmp_path):
    from geometry_msgs.msg import Pose

    sys.path.insert(0, str(SOURCE / "examples" / "ros"))
    from loop_closures import loop_closure

    robot = Robot(ros, ["estimator:=batch", f"output:={tmp_path}/map.g2o"])
    mapper, at = Mapper("batch"), Pose2()  # the same without ROS
    for k in range(2 * lap):
        stamp = START + k * SECOND
        robot.send_odometry(stamp, at)
        mapper.odometry(stamp, at)
        last, at = at, at * wrong_step
    until(lambda: len(robot.path()) == 2 * lap, "the path")
    assert_allclose(robot.path()[:, :2], mapper.trajectory()[:, :2], atol=1e-9)

    measured = Pose2(0.01, -0.02, 0.005)
    for k in range(lap, 2 * lap):
        earlier, later = START + (k - lap) * SECOND, START + k * SECOND
        pose = conventions.write_pose(measured, Pose())
        robot.loops.publish(loop_closure(ros.Time(0, earlier), ros.Time(0, later), pose, covariance(SIGMAS)))
        mapper.loop_closure(earlier, later, measured, conventions.step_covariance(measured, covariance(SIGMAS)))
    expected = mapper.trajectory()
    until(lambda: np.abs(robot.path()[-1, :2] - expected[-1, :2]).max() < 1e-6, "the corrected path")
    assert_allclose(robot.path()[:, :2], expected[:, :2], atol=1e-6)
    stamps = [pose.header.stamp.to_nsec() for pose in robot.last("path").poses]
    assert stamps == mapper.stamps and robot.last("path").header.frame_id == "map"

    # The transform and the covariance come with the next odometry.
    robot.send_odometry(START + 100 * SECOND, at)
    mapper.odometry(START + 100 * SECOND, at)
    until(lambda: robot.last("pose") and robot.last("pose").header.stamp.to_nsec() == START + 100 * SECOND, "the pose")
    due = START + 100 * SECOND + SECOND // 10
    until(lambda: robot.last("tf").transforms[0].header.stamp.to_nsec() == due, "the transform")
    (transform,) = robot.last("tf").transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
    in_map = conventions.spatial(mapper.map_from_odometry).state
    t, r = transform.transform.translation, transform.transform.rotation
    assert_allclose([t.x, t.y, t.z, r.x, r.y, r.z, r.w], in_map, atol=1e-6)
    assert np.abs(in_map[:2]).max() > 0.01  # it does correct
    pose = robot.last("pose").pose
    newest = mapper.estimator.estimate(2 * lap)
    assert conventions.planar(conventions.pose3(pose.pose)).equals(newest, 1e-6)
    assert_allclose(pose.covariance, conventions.message_covariance(newest, mapper.estimator.covariance(2 * lap)), rtol=1e-4, atol=1e-9)

    until(lambda: len(robot.last("markers").markers[0].points) == 2 * lap + 1, "the markers")
    keyframes, steps, loops = robot.last("markers").markers
    assert len(steps.points) == 2 * 2 * lap and len(loops.points) == 2 * lap
    assert (keyframes.ns, steps.ns, loops.ns) == ("keyframes", "odometry", "loop closures")

    robot.end()
    until((tmp_path / "map.g2o").exists, "the file")
    written = cairn.read(tmp_path / "map.g2o")
    assert (written.variable_count, written.factor_count) == (2 * lap + 1, 3 * lap)
    assert_allclose(written.states(Pose2), mapper.trajectory(), atol=1e-5)


def test_what_it_cannot_take_is_said_and_it_goes_on(ros):
    robot = Robot(ros)
    for k in range(4):
        robot.send_odometry(START + k * SECOND, Pose2(float(k), 0.0, 0.0))
    until(lambda: len(robot.path()) == 4, "the path")
    to_base = conventions.frame_at("base_link", START)
    robot.send_pose(robot.loops, "camera@1700000000.0", START + SECOND, Pose2(), covariance(SIGMAS))
    robot.send_pose(robot.loops, to_base, START + 2 * SECOND, Pose2(), [0.0] * 36)
    robot.send_pose(robot.absolute, "earth", START + SECOND, Pose2(), covariance(SIGMAS))
    robot.send_odometry(START, Pose2())
    robot.send_pose(robot.absolute, "map", START + 3 * SECOND, Pose2(13.0, 0.0, 0.0), covariance(SIGMAS))
    until(lambda: abs(robot.path()[-1, 0] - 13) < 1e-3, "the path after an absolute pose")
    said = robot.end()
    for words in ["it is of frame 'camera', but odometry of 'base_link'", "not positive definite; zeros are not taken for 'unknown'", "it is in frame 'earth': expected 'map'", "not later than the last one"]:
        assert words in said, said


def test_a_drive_in_space_with_odometry_that_accumulates(ros, tmp_path):
    robot = Robot(ros, ["planar:=false", "odometry_noise:=accumulated", f"output:={tmp_path}/map.g2o"])
    step = Pose3(Rot3.from_roll_pitch_yaw(0.05, -0.1, 0.3), [1.0, 0.0, 0.1])
    at, sigma, Q = Pose3(), np.zeros((6, 6)), np.diag([4e-4, 1e-4, 1e-4, 1e-6, 1e-6, 4e-6])
    for k in range(5):
        robot.send_odometry(START + k * SECOND, at, conventions.message_covariance(at, sigma))
        A = step.inverse().adjoint()
        at, sigma = at * step, A @ sigma @ A.T + Q
    until(lambda: len(robot.path()) == 5, "the path")
    robot.end()
    until((tmp_path / "map.g2o").exists, "the file")
    written = cairn.read(tmp_path / "map.g2o")
    assert_allclose(written.information("EDGE_SE3:QUAT") @ Q, [np.eye(6)] * 4, atol=1e-3)


def test_an_estimator_that_there_is_not_ends_it_with_what_there_is(ros):
    import rospkg

    node = Path(rospkg.RosPack().get_path("cairn_ros")) / "cairn_node"
    ended = subprocess.run(["/usr/bin/python3", node, "_estimator:=isam9"], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 2 and "incremental_cholesky" in ended.stdout + ended.stderr
