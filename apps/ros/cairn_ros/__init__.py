# SPDX-License-Identifier: BSD-3-Clause
"""A node for ROS 1 that estimates a robot's trajectory with cairn: docs/ros.md.

`conventions`, `odometry` and `mapper` need cairn and NumPy only; `node` connects them to topics and needs rospy.
"""
