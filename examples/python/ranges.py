#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Range-only SLAM with a factor written in Python.

    python3 ranges.py FOLDER [--native]

FOLDER has the logs of a robot that measures distances to radio beacons: odometry.txt (time [s], distance [m], change of
heading [rad] since the row before), ranges.txt (time, sender, receiver, range [m]), truth.txt (time, x, y, heading),
beacons.txt (receiver, x, y). Plaza 1 of Djugash, Singh, Kantor and Zhang (ICRA 2006) is one. With --native the factor is
cairn's own, a bearing and range whose bearing is not measured.
"""
import argparse
import time
from pathlib import Path

import numpy as np

import cairn
from cairn import Point2, Pose2


def residual(pose, beacon, measured):
    """The distance from the robot's position to the beacon, minus what was measured: (n, 1) [m]."""
    return np.hypot(*(beacon - pose[:, :2]).T)[:, None] - measured


def jacobians(pose, beacon, measured):
    """By the robot's step (forward, left, turn) and the beacon's."""
    offset = beacon - pose[:, :2]
    u = offset / np.hypot(*offset.T)[:, None]
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    of_pose = np.stack([-c * u[:, 0] - s * u[:, 1], s * u[:, 0] - c * u[:, 1], np.zeros(len(u))], axis=-1)
    return of_pose[:, None, :], u[:, None, :]


DISTANCE = cairn.FactorType(
    "EDGE_DISTANCE", [Pose2, Point2], residual, residual_size=1, measurement_size=1, jacobians=jacobians
)
SIGMA = 0.75  # of a range [m]
LOSS = "cauchy:scale=1"  # some are reflected


def dead_reckoning(start, odometry):
    """Poses (n, 3): the robot drives each distance, then turns."""
    heading = start[2] + np.concatenate([[0], np.cumsum(odometry[:, 2])])
    steps = odometry[:, 1:2] * np.column_stack([np.cos(heading[:-1]), np.sin(heading[:-1])])
    return np.column_stack([start[:2] + np.vstack([[0, 0], np.cumsum(steps, axis=0)]), heading])


def build(folder, native=False):
    """The graph, and the true trajectory as another."""
    odometry, ranges, truth, beacons = (
        np.loadtxt(Path(folder) / f"{name}.txt") for name in ["odometry", "ranges", "truth", "beacons"]
    )
    graph = cairn.Graph()
    poses = np.arange(len(odometry) + 1)
    graph.add_variables(Pose2, poses, dead_reckoning(truth[0, 1:], odometry))
    graph.fix(0)
    measured = np.column_stack([odometry[:, 1], np.zeros(len(odometry)), odometry[:, 2]])
    graph.add_factors("EDGE_SE2", np.column_stack([poses[:-1], poses[1:]]), measured, sigmas=[0.02, 0.01, 0.01])

    # Beacons are known to some metres; each range belongs to the pose nearest in time.
    names = {int(name): 1_000_000 + k for k, name in enumerate(beacons[:, 0])}
    graph.add_variables(Point2, list(names.values()), beacons[:, 1:] + [3.0, -3.0])
    for id, place in zip(names.values(), beacons[:, 1:] + [3.0, -3.0]):
        graph.add(cairn.Prior(id, Point2(*place)), sigmas=5.0)
    times = np.concatenate([truth[:1, 0], odometry[:, 0]])
    nearest = np.searchsorted((times[1:] + times[:-1]) / 2, ranges[:, 0])
    pairs = np.column_stack([nearest, [names[int(receiver)] for receiver in ranges[:, 2]]])
    if native:
        values = np.column_stack([np.zeros(len(ranges)), ranges[:, 3]])
        graph.add_factors("EDGE_BEARING_RANGE_SE2_XY", pairs, values, sigmas=[np.inf, SIGMA], loss=LOSS)
    else:
        graph.add_factors(DISTANCE, pairs, ranges[:, 3], sigmas=SIGMA, loss=LOSS)

    true = cairn.Graph()
    true.add_variables(Pose2, poses, truth[:, 1:])
    return graph, true


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder")
    parser.add_argument("--native", action="store_true", help="cairn's own factor")
    options = parser.parse_args()
    graph, true = build(options.folder, options.native)
    print(f"dead reckoning: {cairn.evaluate(graph, true).ate_translation:.2f} m from the truth")
    begin = time.perf_counter()
    summary = cairn.optimize(graph, initial=None)
    seconds = time.perf_counter() - begin
    print(f"{len(summary.iterations)} iterations in {seconds:.3f} s, {summary.status}, chi2 {summary.chi2:.6g}")
    print(f"estimate: {cairn.evaluate(graph, true).ate_translation:.2f} m from the truth")


if __name__ == "__main__":
    main()
