# SPDX-License-Identifier: BSD-3-Clause
"""The pose graph behind the node, against graphs and noise worked out in plain NumPy; no ROS is needed."""
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
from cairn import Pose2, Pose3, Rot3
from cairn_ros.mapper import Mapper
from cairn_ros.odometry import MotionNoise, Odometry, motion_covariance

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import dense  # noqa: E402
import test_docs  # noqa: E402

SECOND = 10**9


def drive(mapper, walk):
    """The dense walk's odometry as poses in its own frame, one each second; returns these."""
    at, poses = Pose2(), [Pose2()]
    mapper.odometry(0, at)
    for i, j, z, _ in walk.edges:
        if j == i + 1:
            at = at * Pose2(*z)
            poses.append(at)
            mapper.odometry(j * SECOND, at)
    return poses


def walk_with(noise):
    """dense.loop() with odometry as certain as `noise` says."""
    walk = dense.loop()
    walk.edges = [
        (i, j, z, np.linalg.inv(noise.covariance(Pose2(*z))) if j == i + 1 else information) for i, j, z, information in walk.edges
    ]
    return walk


@pytest.mark.parametrize("estimator", ["incremental_cholesky", "batch", "periodic_batch:every=5", "incremental_qr:every=1"])
def test_the_trajectory_is_that_of_dense_gauss_newton(estimator):
    noise = MotionNoise(0.1, 0.05, 0.1)
    walk = walk_with(noise)
    mapper = Mapper(estimator, keyframe_distance=0.5, noise=noise)
    poses = drive(mapper, walk)
    assert mapper.map_from_odometry.equals(Pose2(), 1e-12)  # nothing corrects it yet
    for i, j, z, information in walk.edges:
        if j != i + 1:
            assert mapper.loop_closure(i * SECOND, j * SECOND, Pose2(*z), np.linalg.inv(information))
    corrected = mapper.map_from_odometry * poses[-1]
    assert corrected.equals(mapper.estimator.estimate(24), 1e-12) and not corrected.equals(poses[-1], 0.01)
    mapper.estimator.update(full=True)
    walk.optimize()
    assert_allclose(mapper.trajectory(), walk.poses, atol=1e-5)
    assert mapper.links == [(i, j) for i, j, _, _ in walk.edges if j != i + 1]
    assert_allclose(mapper.estimator.covariance(24), walk.covariance(24, 24), rtol=1e-4, atol=1e-8)


def test_the_order_of_messages_does_not_matter():
    walk = walk_with(MotionNoise())
    first, second = Mapper("batch"), Mapper("batch")
    drive(first, walk)
    loops = [(i * SECOND, j * SECOND, Pose2(*z), np.linalg.inv(information)) for i, j, z, information in walk.edges if j != i + 1]
    for loop in loops:
        assert first.loop_closure(*loop)
        assert not second.loop_closure(*loop)  # of the future
    drive(second, walk)
    assert sorted(second.links) == sorted(first.links)
    assert_allclose(second.trajectory(), first.trajectory(), atol=1e-6)
    assert first.notes == second.notes


def test_keyframes_come_with_distance_and_with_angle():
    mapper = Mapper(keyframe_distance=1.0, keyframe_angle=0.5)
    made = [mapper.odometry(k, Pose2(0.3 * k, 0.0, 0.0)) for k in range(8)]
    assert [k for k in range(8) if made[k]] == [0, 4]
    turning = Mapper(keyframe_distance=1.0, keyframe_angle=0.5)
    assert [k for k in range(8) if turning.odometry(k, Pose2(0.0, 0.0, 0.2 * k))] == [0, 3, 6]
    with pytest.raises(ValueError, match="above 0"):
        Mapper(keyframe_angle=0)


def random_covariance(random, d):
    root = random.normal(size=(d, d)) * 0.004
    return root @ root.T + 1e-6 * np.eye(d)


def propagated(function, covariances, h=1e-6):
    """The covariance of function(errors…) to first order, by central differences."""
    total = 0.0
    zeros = [np.zeros(len(sigma)) for sigma in covariances]
    for k, sigma in enumerate(covariances):

        def moved(step):
            return function(*zeros[:k], step, *zeros[k + 1 :])

        J = np.column_stack([(moved(h * e) - moved(-h * e)) / (2 * h) for e in np.eye(len(sigma))])
        total = total + J @ sigma @ J.T
    return total


@pytest.mark.parametrize("planar", [True, False])
def test_a_loop_closure_between_keyframes_is_carried_to_them_with_its_noise(planar):
    """The measurement of the factor, and its covariance by differences with respect to all three errors."""
    random = np.random.default_rng(5)
    d = 3 if planar else 6
    if planar:
        path = [Pose2(0.4 * k, 0.02 * k * k, 0.15 * k) for k in range(21)]
    else:
        path = [Pose3(Rot3.from_roll_pitch_yaw(0.1 * k, 0.05 * k, 0.15 * k), [0.4 * k, 0.02 * k * k, 0.03 * k]) for k in range(21)]
    pose = type(path[0])
    noise = MotionNoise(0.01, 0.005, 0.01)
    mapper = Mapper("batch", planar=planar, keyframe_distance=2.0, keyframe_angle=10, noise=noise)
    for k, at in enumerate(path):
        mapper.odometry(k * SECOND, at)
    sigma = random_covariance(random, d)
    measured = pose.exp(random.normal(size=d) * 0.5)
    early, late = int(1.25 * SECOND), 12 * SECOND
    assert mapper.loop_closure(early, late, measured, sigma)
    ((a, b),) = mapper.links
    assert 0 <= a < b and mapper.stamps[a] != early and mapper.stamps[b] != late

    graph = mapper.estimator.graph()
    tag = "EDGE_SE2" if planar else "EDGE_SE3:QUAT"
    row = int(np.flatnonzero((graph.factor_ids(tag) == [a, b]).all(axis=1))[-1])
    A = path[mapper.stamps[a] // SECOND].between(path[1] * pose.exp(0.25 * path[1].between(path[2]).log()))
    B = path[mapper.stamps[b] // SECOND].between(path[12])
    value = A * measured * B.inverse()
    assert pose.from_state(graph.measurements(tag)[row]).equals(value, 1e-9)

    def error(alpha, zeta, beta):
        return value.local(A * pose.exp(alpha) * measured * pose.exp(zeta) * (B * pose.exp(beta)).inverse())

    expected = propagated(error, [noise.covariance(A), sigma, noise.covariance(B)])
    assert_allclose(np.linalg.inv(graph.information(tag)[row]), expected, atol=1e-6 * np.abs(expected).max())


def test_absolute_poses_place_the_map():
    mapper = Mapper("batch", keyframe_distance=1.0)
    for k in range(6):
        mapper.odometry(k * SECOND, Pose2(float(k), 0.0, 0.0))
    assert mapper.absolute(2 * SECOND, Pose2(10.0, 5.0, np.pi / 2), np.eye(3) * 1e-4)
    assert mapper.map_from_odometry.equals(Pose2(10.0, 3.0, np.pi / 2), 1e-6)
    # Between keyframes: the pose at 2.5 s is half a metre ahead of the one at 2 s.
    assert mapper.absolute(int(2.5 * SECOND), Pose2(10.0, 5.5, np.pi / 2), np.eye(3) * 1e-4)
    assert mapper.map_from_odometry.equals(Pose2(10.0, 3.0, np.pi / 2), 1e-6)
    assert mapper.estimator.chi2() < 1e-9


def test_a_robust_loss_gives_a_wrong_loop_closure_little_weight():
    lap, step = 8, Pose2(1.0, 0.0, np.pi / 4)
    errors = []
    for loss in ["cauchy:scale=1", None]:
        mapper, at, truth = Mapper("batch", loss=loss), Pose2(), []
        for k in range(3 * lap):
            mapper.odometry(k * SECOND, at)
            truth.append(at.state)
            if k >= lap:
                mapper.loop_closure((k - lap) * SECOND, k * SECOND, Pose2(), np.eye(3) * 0.01)
            at = at * step
        mapper.loop_closure(3 * SECOND, 15 * SECOND, Pose2(), np.eye(3) * 0.01)  # these are opposite
        mapper.estimator.update(full=True)
        errors.append(np.abs(mapper.trajectory()[:, :2] - np.array(truth)[:, :2]).max())
    assert errors[0] < 0.02 and errors[1] > 0.2, errors


def test_what_makes_no_sense_is_refused_and_changes_nothing():
    mapper = Mapper()
    for k in range(4):
        mapper.odometry((10 + k) * SECOND, Pose2(float(k), 0.0, 0.0))
    before = mapper.trajectory()
    sigma = np.eye(3)
    with pytest.raises(ValueError, match="not later than the last one"):
        mapper.odometry(12 * SECOND, Pose2())
    with pytest.raises(ValueError, match="older than all odometry, which begins at 10.000 s"):
        mapper.loop_closure(9 * SECOND, 12 * SECOND, Pose2(), sigma)
    with pytest.raises(ValueError, match="belong to keyframe 1"):
        mapper.loop_closure(11 * SECOND, 11 * SECOND + 1, Pose2(), sigma)
    with pytest.raises(cairn.Error):
        mapper.loop_closure(10 * SECOND, 13 * SECOND, Pose2(), -sigma)
    assert mapper.links == [] and mapper.estimator.factor_count == 3
    assert mapper.odometry(14 * SECOND, Pose2(4.0, 0.0, 0.0))  # and it goes on
    assert_allclose(mapper.trajectory()[:4], before, atol=1e-12)


def test_what_waited_and_cannot_be_is_noted():
    mapper = Mapper()
    assert not mapper.loop_closure(1 * SECOND, 12 * SECOND, Pose2(), np.eye(3))  # nothing is known yet
    mapper.odometry(10 * SECOND, Pose2())
    mapper.odometry(13 * SECOND, Pose2(3.0, 0.0, 0.0))
    assert any("1.000 s is older than all odometry" in note for note in mapper.notes)
    for _ in range(1000):
        mapper.absolute(99 * SECOND, Pose2(), np.eye(3))
    with pytest.raises(ValueError, match="1000 measurements wait"):
        mapper.absolute(99 * SECOND, Pose2(), np.eye(3))


def test_odometry_is_interpolated_and_exact_at_its_times():
    odometry = Odometry(Pose2)
    turn = Pose2.exp([1.0, 0.0, 1.0])
    for k, pose in enumerate([Pose2(), turn, turn * turn]):
        assert odometry.add(k * SECOND, pose)
    assert not odometry.add(2 * SECOND, Pose2())
    assert odometry.at(SECOND).equals(turn, 0)
    assert odometry.at(SECOND // 2).equals(Pose2.exp([0.5, 0.0, 0.5]), 1e-12)
    assert odometry.at(SECOND + SECOND // 4).equals(Pose2.exp([1.25, 0.0, 1.25]), 1e-12)


def test_the_noise_of_a_motion_does_not_depend_on_how_it_is_divided():
    noise = MotionNoise(0.1, 0.05, 0.1)
    noise.least = 0.0
    whole = noise.covariance(Pose2(4.0, 0.0, 0.0))
    assert_allclose(whole, 4 * noise.covariance(Pose2(1.0, 0.0, 0.0)))
    assert_allclose(np.sqrt(np.diagonal(whole)), [0.2, 0.2, 0.1])
    assert_allclose(noise.covariance(Pose2(0.0, 0.0, 0.25))[2, 2], 0.1**2 * 0.25)
    assert noise.covariance(Pose3()).shape == (6, 6)
    with pytest.raises(ValueError, match="noise of turn is -1"):
        MotionNoise(turn=-1)


@pytest.mark.parametrize("pose", [Pose2, Pose3])
def test_accumulated_covariances_give_those_of_motions(pose):
    random = np.random.default_rng(2)
    d = 3 if pose is Pose2 else 6
    motion = pose.exp(random.normal(size=d))
    before, Q = random_covariance(random, d), random_covariance(random, d)
    after = propagated(lambda a, q: motion.local(pose.exp(a) * motion * pose.exp(q)), [before, Q])
    assert_allclose(motion_covariance(motion, before, after), Q, atol=1e-6 * np.abs(after).max())
    assert motion_covariance(motion, before, before * 0.5) is None  # it does not accumulate


def test_a_mapper_takes_them():
    Q = np.diag([4e-4, 1e-4, 1e-4])
    mapper = Mapper("batch", keyframe_distance=0.5)
    step, at, sigma = Pose2(1.0, 0.0, 0.3), Pose2(), np.zeros((3, 3))
    mapper.odometry(0, at, sigma)
    for k in range(1, 5):
        A = step.inverse().adjoint()
        at, sigma = at * step, A @ sigma @ A.T + Q
        mapper.odometry(k, at, sigma)
    assert_allclose(mapper.estimator.graph().information("EDGE_SE2"), [np.linalg.inv(Q)] * 4, rtol=1e-6, atol=1e-6)


def test_the_block_of_the_page_runs(tmp_path):
    assert test_docs.run(Path(__file__).resolve().parents[2] / "docs" / "ros.md", tmp_path) >= 8
