# SPDX-License-Identifier: BSD-3-Clause
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
import dense


def trajectory(poses):
    graph = cairn.Graph()
    graph.add_variables(cairn.Pose2, np.arange(len(poses)), poses)
    return graph


def test_a_rigid_motion_is_no_error():
    poses = dense.loop().poses
    moved = np.array([dense.compose(np.array([3.0, -2.0, 1.0]), pose) for pose in poses])
    error = cairn.evaluate(trajectory(moved), trajectory(poses))
    assert error.poses == len(poses)
    assert_allclose([error.ate_translation, error.rpe_translation, error.rpe_all_translation], 0, atol=1e-12)


def test_errors_are_root_mean_squares():
    # A straight line; the middle pose is 0.3 m beside it. By hand, after the best rigid motion:
    truth = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    estimate = truth + [[0, 0, 0], [0, 0.3, 0], [0, 0, 0]]
    error = cairn.evaluate(trajectory(estimate), trajectory(truth))
    assert_allclose(error.ate_translation, np.sqrt((0.1**2 + 0.2**2 + 0.1**2) / 3), rtol=1e-9)
    # From a to the middle and from there to b the way is 0.3 m off, of two pairs.
    assert_allclose(error.rpe_translation, 0.3, rtol=1e-9)
    assert_allclose(error.rpe_all_translation, np.sqrt(2 * 0.3**2 / 3), rtol=1e-9)
    assert_allclose(error.ate_rotation, 0, atol=1e-9)


def test_optimising_brings_the_estimate_nearer_to_the_truth():
    graph, truth = cairn.generate("manhattan", seed=2, poses=400)
    before = cairn.evaluate(graph, truth).ate_translation
    cairn.optimize(graph)
    assert cairn.evaluate(graph, truth).ate_translation < 0.5 * before


def test_files_with_time_stamps_are_paired_by_time(tmp_path):
    (tmp_path / "truth.tum").write_text("".join(f"{0.5 * k} {k} 0 0 0 0 0 1\n" for k in range(6)))
    (tmp_path / "estimate.tum").write_text("".join(f"{0.5 * k + 0.001} {k} {0.1 * (k == 3)} 0 0 0 0 1\n" for k in range(1, 6)))
    estimate, truth = (cairn.read(tmp_path / f"{name}.tum") for name in ["estimate", "truth"])
    assert_allclose(truth.stamps, 0.5 * np.arange(6))
    assert cairn.evaluate(estimate, truth, match="stamp").poses == 5
    assert cairn.evaluate(estimate, truth).rpe_translation < 0.2  # pose k beside pose k
    assert_allclose(cairn.evaluate(estimate, truth, match="id").ate_translation, cairn.evaluate(estimate, truth, match="stamp").ate_translation, rtol=0.5)
    with pytest.raises(cairn.Error, match="the truth has no time stamps"):
        cairn.evaluate(estimate, trajectory(dense.loop().poses), match="stamp")
    with pytest.raises(cairn.Error, match="expected 'auto', 'id' or 'stamp'"):
        cairn.evaluate(estimate, truth, match="time")


def test_a_trajectory_in_the_axes_of_a_camera_is_warned_of(tmp_path):
    robot, _ = cairn.generate("sphere", seed=1, turns=3, poses_per_turn=10)
    robot.write(tmp_path / "robot.kitti", format="kitti")
    given = cairn.read(tmp_path / "robot.kitti", format="kitti")
    camera = cairn.read(tmp_path / "robot.kitti", format="kitti", axes="camera")
    for pair, which in (((given, camera), "estimate"), ((camera, given), "truth")):
        with pytest.warns(UserWarning, match=f"axes='camera' for cairn.read of the {which} the ATE in rotation is"):
            cairn.evaluate(*pair)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cairn.evaluate(given, given)


def test_a_planar_estimate_beside_a_spatial_truth_is_warned_of():
    truth = cairn.Graph()
    height = np.array([0.0, 0.4, 0.1])  # of three poses on a line, level
    spatial = np.column_stack([np.arange(3.0), np.zeros(3), height, np.zeros((3, 3)), np.ones(3)])
    truth.add_variables(cairn.Pose3, np.arange(3), spatial)
    estimate = trajectory(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]))
    for a, b in [(estimate, truth), (truth, estimate)]:
        with pytest.warns(UserWarning, match="heights, roll and pitch count as errors; planar=True"):
            assert cairn.evaluate(a, b).ate_translation > 0.1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert_allclose(cairn.evaluate(estimate, truth, planar=True).ate_translation, 0, atol=1e-12)
        cairn.evaluate(truth, truth)
        cairn.evaluate(estimate, estimate)


def test_less_than_two_common_poses_are_an_error():
    with pytest.raises(cairn.Error):
        cairn.evaluate(trajectory(np.zeros((1, 3))), trajectory(np.zeros((5, 3))))
