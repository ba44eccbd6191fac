# SPDX-License-Identifier: BSD-3-Clause
"""The node: topics and parameters on one side, a `Mapper` on the other. docs/ros.md lists them."""
import threading

import rospy
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry, Path
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

import cairn
from cairn import Pose2, Pose3

from . import conventions
from .mapper import Mapper
from .odometry import MotionNoise


class Node:
    def __init__(self):
        parameter = rospy.get_param
        self.map_frame = parameter("~map_frame", "map")
        self.tolerance = rospy.Duration(parameter("~transform_tolerance", 0.1))
        self.output = parameter("~output", "")
        self.angles = parameter("~orientation_covariance", "fixed_axes")
        if self.angles not in conventions.ANGLES:
            raise ValueError(f"~orientation_covariance is '{self.angles}' (on offer: {', '.join(conventions.ANGLES)})")
        odometry_noise = parameter("~odometry_noise", "motion")
        if odometry_noise not in ("motion", "accumulated"):
            raise ValueError(f"~odometry_noise is '{odometry_noise}' (on offer: motion, accumulated)")
        self.accumulated = odometry_noise == "accumulated"
        self.mapper = Mapper(
            parameter("~estimator", "incremental_cholesky"),
            planar=parameter("~planar", True),
            keyframe_distance=parameter("~keyframe_distance", 0.5),
            keyframe_angle=parameter("~keyframe_angle", 0.5),
            noise=MotionNoise(*(parameter(f"~{name}_noise", value) for name, value in [("translation", 0.05), ("rotation", 0.02), ("turn", 0.05)])),
            loss=parameter("~loss", "") or None,
        )
        self.lock = threading.Lock()  # rospy calls each topic from a thread of its own
        self.frames = None  # of odometry, of the robot
        self.changed = False
        self.tf = rospy.Publisher("/tf", TFMessage, queue_size=100)
        self.pose = rospy.Publisher("~pose", PoseWithCovarianceStamped, queue_size=10)
        self.path = rospy.Publisher("~path", Path, queue_size=1, latch=True)
        self.markers = rospy.Publisher("~markers", MarkerArray, queue_size=1, latch=True)
        rospy.Subscriber("odom", Odometry, self.take_odometry, queue_size=1000)
        for topic in ("loop_closures", "absolute_poses"):
            rospy.Subscriber(topic, PoseWithCovarianceStamped, self.take_measurement, queue_size=1000)
        self.timer = rospy.Timer(rospy.Duration(1 / parameter("~publish_rate", 2.0)), self.publish_map)
        rospy.on_shutdown(self.write)

    # ---- what comes

    def take_odometry(self, message):
        try:
            with self.lock:
                self._add_odometry(message)
        except (ValueError, cairn.Error) as error:
            rospy.logwarn_throttle(5, f"odometry is ignored: {error}")

    def _add_odometry(self, message):
        frames = (message.header.frame_id.lstrip("/"), message.child_frame_id.lstrip("/"))
        if not all(frames):
            raise ValueError("it needs both frame_id and child_frame_id")
        if self.frames not in (None, frames):
            raise ValueError(f"it is of {frames[1]} in {frames[0]}, after {self.frames[1]} in {self.frames[0]}")
        pose = self._pose(message.pose.pose)
        covariance = conventions.step_covariance(pose, message.pose.covariance, self.angles, semidefinite=True) if self.accumulated else None
        made = self.mapper.odometry(message.header.stamp.to_nsec(), pose, covariance)
        self.frames = frames
        self._show_notes()
        if made:
            self.changed = True
            self._publish_pose(message.header.stamp)
        self._publish_transform(message.header.stamp)

    def take_measurement(self, message):
        try:
            with self.lock:
                self._add_measurement(message)
        except (ValueError, cairn.Error) as error:
            rospy.logwarn(f"a measured pose is refused: {error}")

    def _add_measurement(self, message):
        frame, earlier = conventions.split_frame(message.header.frame_id)
        measured = self._pose(message.pose.pose)
        covariance = conventions.step_covariance(measured, message.pose.covariance, self.angles)
        stamp = message.header.stamp.to_nsec()
        if earlier is None:
            if frame != self.map_frame:
                raise ValueError(f"it is in frame '{frame}': expected '{self.map_frame}', or such as 'base_link@1700000000.25' for a loop closure")
            self.mapper.absolute(stamp, measured, covariance)
        else:
            if self.frames and frame != self.frames[1]:
                raise ValueError(f"it is of frame '{frame}', but odometry of '{self.frames[1]}'")
            self.mapper.loop_closure(earlier, stamp, measured, covariance)
        self.changed = True
        self._show_notes()

    def _pose(self, message):
        pose = conventions.pose3(message)
        return conventions.planar(pose) if self.mapper.pose_type is Pose2 else pose

    def _show_notes(self):
        for note in self.mapper.notes:
            rospy.logwarn(note)
        self.mapper.notes.clear()

    # ---- what goes

    def _publish_transform(self, stamp):
        transform = TransformStamped()
        transform.header.stamp = stamp + self.tolerance
        transform.header.frame_id, transform.child_frame_id = self.map_frame, self.frames[0]
        conventions.write_pose(self.mapper.map_from_odometry, transform.transform)
        self.tf.publish(TFMessage([transform]))

    def _publish_pose(self, stamp):
        if not self.pose.get_num_connections():
            return  # a covariance costs a solve
        newest = len(self.mapper.stamps) - 1
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = stamp, self.map_frame
        pose = self.mapper.estimator.estimate(newest)
        conventions.write_pose(pose, message.pose.pose)
        message.pose.covariance = conventions.message_covariance(pose, self.mapper.estimator.covariance(newest))
        self.pose.publish(message)

    def publish_map(self, _=None):
        with self.lock:
            if not self.changed:
                return
            self.changed = False
            states, stamps, links = self.mapper.trajectory(), list(self.mapper.stamps), list(self.mapper.links)
        poses = [self.mapper.pose_type.from_state(state) for state in states]
        path = Path()
        path.header.stamp, path.header.frame_id = rospy.Time.now(), self.map_frame
        for stamp, pose in zip(stamps, poses):
            stamped = PoseStamped()
            stamped.header.stamp, stamped.header.frame_id = rospy.Time(0, stamp), self.map_frame
            conventions.write_pose(pose, stamped.pose)
            path.poses.append(stamped)
        self.path.publish(path)
        points = [Point(*map(float, conventions.spatial(pose).translation)) for pose in poses]
        steps = [point for k in range(1, len(points)) for point in (points[k - 1], points[k])]
        loops = [points[end] for link in links for end in link]
        self.markers.publish(MarkerArray([
            self._marker(path.header, 0, "keyframes", Marker.POINTS, points, 0.1, (0.1, 0.3, 0.7)),
            self._marker(path.header, 0, "odometry", Marker.LINE_LIST, steps, 0.03, (0.1, 0.3, 0.7)),
            self._marker(path.header, 0, "loop closures", Marker.LINE_LIST, loops, 0.03, (0.8, 0.2, 0.1)),
        ]))

    @staticmethod
    def _marker(header, id, namespace, kind, points, size, colour):
        marker = Marker(header=header, ns=namespace, id=id, type=kind, points=points)
        marker.action = Marker.ADD if points else Marker.DELETE
        marker.pose.orientation.w = 1.0
        marker.scale.x = marker.scale.y = size
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = *colour, 1.0
        return marker

    def write(self):
        with self.lock:
            if self.output and self.mapper.stamps:
                self.mapper.estimator.graph().write(self.output)


def main():
    rospy.init_node("cairn")
    try:
        node = Node()  # noqa: F841  lives as long as the process
    except (ValueError, cairn.Error) as error:
        rospy.logfatal(str(error))
        raise SystemExit(2)
    rospy.spin()
