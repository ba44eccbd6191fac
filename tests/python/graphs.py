# SPDX-License-Identifier: BSD-3-Clause
"""Graphs that several tests share."""
import numpy as np

import cairn


def from_dense(dense):
    """The same graph in cairn, added one by one; the first pose is fixed."""
    graph = cairn.Graph()
    for k, pose in enumerate(dense.poses):
        graph.add(k, cairn.Pose2(*pose), fixed=k == 0)
    for i, j, z, information in dense.edges:
        graph.add(cairn.Between(i, j, cairn.Pose2(*z)), information=information)
    return graph


def arrays_of(dense):
    """ids, states, pairs, measurements, information."""
    ids = np.arange(len(dense.poses))
    pairs = np.array([[i, j] for i, j, _, _ in dense.edges])
    measurements = np.array([z for _, _, z, _ in dense.edges])
    information = np.array([omega for _, _, _, omega in dense.edges])
    return ids, dense.poses, pairs, measurements, information
