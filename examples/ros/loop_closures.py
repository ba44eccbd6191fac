# SPDX-License-Identifier: BSD-3-Clause
"""What a front end publishes for the node of docs/ros.md where it has matched two scans."""
from geometry_msgs.msg import PoseWithCovarianceStamped


def loop_closure(earlier, later, pose, covariance, frame="base_link"):
    """earlier, later: rospy.Time of two scans; pose: geometry_msgs/Pose, where the robot was at the later time as seen from the earlier
    one; covariance: 36 numbers."""
    message = PoseWithCovarianceStamped()
    message.header.stamp = later
    message.header.frame_id = f"{frame}@{earlier.secs}.{earlier.nsecs:09d}"
    message.pose.pose = pose
    message.pose.covariance = covariance
    return message
