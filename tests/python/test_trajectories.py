# SPDX-License-Identifier: BSD-3-Clause
"""Files of trajectories and their errors against plain NumPy: pairing, alignment and errors are computed here anew."""
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn

C = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # a robot's coordinates to a camera's


def rotation(q):
    """Of a quaternion x y z w."""
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def angle(R):
    """Of a rotation, precise where it is small, too."""
    return 2 * np.arcsin(min(1.0, np.linalg.norm(R - np.eye(3)) / np.sqrt(8.0)))


def aligned(e, t, planar, with_scale):
    """Umeyama (1991): s, R, u with sum |t - (s R e + u)|^2 least over positions (n, 3)."""
    e0, t0 = e - e.mean(0), t - t.mean(0)
    M = t0.T @ e0
    if planar:
        phi = np.arctan2(M[1, 0] - M[0, 1], M[0, 0] + M[1, 1])
        R = np.array([[np.cos(phi), -np.sin(phi), 0], [np.sin(phi), np.cos(phi), 0], [0, 0, 1]])
    else:
        U, _, V = np.linalg.svd(M)
        R = U @ np.diag([1, 1, np.sign(np.linalg.det(U @ V))]) @ V
    s = np.trace(R.T @ M) / np.sum(e0**2) if with_scale else 1.0
    return s, R, t.mean(0) - s * R @ e.mean(0)


def errors(estimate, truth, planar, with_scale):
    """Scale and the six root mean squares [m, deg] of lists of (R, t) that belong together."""
    e, t = (np.array([p for _, p in poses]) for poses in (estimate, truth))
    s, R, u = aligned(e, t, planar, with_scale)
    ate = [(t[k] - (s * R @ e[k] + u), angle(truth[k][0].T @ R @ estimate[k][0])) for k in range(len(e))]

    def relative(i, j):
        ours = estimate[i][0].T @ (s * (e[j] - e[i])), estimate[i][0].T @ estimate[j][0]
        theirs = truth[i][0].T @ (t[j] - t[i]), truth[i][0].T @ truth[j][0]
        return ours[0] - theirs[0], angle(theirs[1].T @ ours[1])

    n = len(e)
    result = [s]
    for pairs in [ate, [relative(k, k + 1) for k in range(n - 1)], [relative(i, j) for i in range(n) for j in range(i + 1, n)]]:
        result += [np.sqrt(np.mean([d @ d for d, _ in pairs])), np.degrees(np.sqrt(np.mean([a * a for _, a in pairs])))]
    return result


def nearest(ours, theirs, most):
    """By rising difference, each at most once and in the order of time."""
    taken = []
    for d, i, j in sorted((abs(a - b), i, j) for i, a in enumerate(ours) for j, b in enumerate(theirs)):
        if d <= most and all(i != k and j != m and (i < k) == (j < m) for k, m in taken):
            taken.append((i, j))
    return sorted(taken)


def drive(rng, n, planar):
    """Quaternions and positions (n, 7): x y z qx qy qz qw."""
    poses = np.zeros((n, 7))
    poses[:, :3] = np.cumsum(rng.normal(size=(n, 3)), axis=0)
    poses[:, 3:] = np.array([0.0, 0, 0, 1]) + 0.8 * np.cumsum(0.3 * rng.normal(size=(n, 4)), axis=0)
    if planar:
        poses[:, [2, 3, 4]] = 0.0
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1)[:, None]
    return poses


def disturbed(rng, poses, planar, scale):
    other = poses.copy()
    other[:, :3] = scale * (poses[:, :3] + 0.2 * rng.normal(size=(len(poses), 3)))
    other[:, 3:] += 0.05 * rng.normal(size=(len(poses), 4))
    if planar:
        other[:, [2, 3, 4]] = 0.0
    other[:, 3:] /= np.linalg.norm(other[:, 3:], axis=1)[:, None]
    return other


def text(numbers):
    return " ".join(f"{v:.17g}" for v in numbers)


def matrix(pose):
    return np.column_stack([rotation(pose[3:]), pose[:3]])


def write(kind, path, poses, stamps, planar):
    """Writes the poses in a format; what its reader is to make of them, (R, t)."""
    rows = []
    for k, pose in enumerate(poses):
        if kind == "tum":
            rows.append(f"{stamps[k]:.6f} {text(pose)}")
        elif kind == "tum of ids":
            rows.append(f"{k} {text(pose)}")
        elif kind == "tum in ns":
            rows.append(f"{round(stamps[k] * 1e6)}000 {text(pose)}")
        elif kind == "tum with commas":
            rows.append(f"{stamps[k]:.15e},{text(pose).replace(' ', ',')}")
        elif kind == "euroc":
            rows.append(f"{round(stamps[k] * 1e6)}000,{text(pose[[0, 1, 2, 6, 3, 4, 5]]).replace(' ', ',')},0,0,0,1,1,1,2,2,2")
        elif kind == "kitti":
            rows.append(text(matrix(pose).ravel()))
        elif kind == "table":
            rows.append(text([k, pose[0], pose[1], 2 * np.arctan2(pose[5], pose[6])]))
        elif planar:
            rows.append(f"VERTEX_SE2 {k} " + text([pose[0], pose[1], 2 * np.arctan2(pose[5], pose[6])]))
        else:
            rows.append(f"VERTEX_SE3:QUAT {k} " + text(pose))
    path.write_text("\n".join(rows) + "\n")
    return [(rotation(pose[3:]), pose[:3]) for pose in poses]


TIMED = ["tum", "tum in ns", "tum with commas", "euroc"]
BY_NUMBER = ["tum of ids", "kitti", "g2o"]


def found(error):
    return [error.scale, error.ate_translation, error.ate_rotation, error.rpe_translation, error.rpe_rotation, error.rpe_all_translation, error.rpe_all_rotation]


def evaluated(a, b, **how):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return found(cairn.evaluate(a, b, **how))


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("scale", [1.0, 0.37])
def test_errors_are_those_of_an_independent_computation_whatever_the_format(tmp_path, planar, scale):
    rng = np.random.default_rng(int(100 * scale) + planar)
    n = 24
    truth = drive(rng, n, planar)
    estimate = disturbed(rng, truth, planar, scale)
    stamps = 1403715524.25 + 0.05 * np.arange(n)
    numbered = BY_NUMBER + (["table"] if planar else [])
    for a, b in [(x, y) for x in TIMED for y in TIMED] + [(x, y) for x in numbered for y in numbered]:
        ours = write(a, tmp_path / "estimate", estimate, stamps + 0.003, planar)
        theirs = write(b, tmp_path / "truth", truth, stamps, planar)
        graphs = [cairn.read(tmp_path / name) for name in ["estimate", "truth"]]
        for with_scale in [False, True]:
            expected = errors(ours, theirs, planar, with_scale)
            assert_allclose(evaluated(*graphs, align_scale=with_scale), expected, rtol=1e-9, atol=1e-9, err_msg=f"{a} {b}")


def test_poses_of_other_times_are_paired_as_by_hand(tmp_path):
    rng = np.random.default_rng(5)
    truth = drive(rng, 60, False)
    times = 1403715524 + np.cumsum(rng.uniform(0.02, 0.08, size=60))
    chosen = np.sort(rng.choice(60, size=25, replace=False))
    estimate = disturbed(rng, truth[chosen], False, 1.0)
    late = times[chosen] + rng.uniform(-0.012, 0.012, size=25)
    ours = write("tum", tmp_path / "estimate", estimate, late, False)
    theirs = write("euroc", tmp_path / "truth", truth, times, False)
    pairs = nearest(np.round(late, 6), np.round(times, 6), 0.01)
    assert 10 < len(pairs) < 25
    expected = errors([ours[i] for i, _ in pairs], [theirs[j] for _, j in pairs], False, False)
    a, b = cairn.read(tmp_path / "estimate"), cairn.read(tmp_path / "truth")
    assert cairn.evaluate(a, b).poses == len(pairs)
    assert_allclose(evaluated(a, b), expected, rtol=1e-9)


def test_axes_of_a_camera_are_those_of_a_robot_by_choice(tmp_path):
    rng = np.random.default_rng(6)
    poses = drive(rng, 12, False)
    robot = write("g2o", tmp_path / "robot.g2o", poses, None, False)
    rows = [np.column_stack([C @ R @ C.T, C @ t]) for R, t in robot]
    (tmp_path / "camera.txt").write_text("\n".join(text(row.ravel()) for row in rows) + "\n")
    as_it_is, turned = (cairn.read(tmp_path / "camera.txt", axes=axes) for axes in ["robot", "camera"])
    truth = cairn.read(tmp_path / "robot.g2o")
    assert evaluated(as_it_is, truth)[2] > 90
    assert_allclose(evaluated(turned, truth)[1:], 0, atol=1e-9)
    with pytest.raises(cairn.Error, match="expected 'robot' or 'camera'"):
        cairn.read(tmp_path / "camera.txt", axes="ship")
    (tmp_path / "graph.g2o").write_text((tmp_path / "robot.g2o").read_text() + "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 " + text([1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 1]) + "\n")
    with pytest.raises(cairn.Error, match="axes='camera': .*it has factors"):
        cairn.read(tmp_path / "graph.g2o", axes="camera")


def test_times_stay_with_a_trajectory_and_can_be_set(tmp_path):
    rng = np.random.default_rng(7)
    poses, stamps = drive(rng, 8, False), 1403715524.5 + np.arange(8) / 7
    write("euroc", tmp_path / "a.csv", poses, stamps, False)
    a = cairn.read(tmp_path / "a.csv")
    a.write(tmp_path / "b.tum")
    assert_allclose(cairn.read(tmp_path / "b.tum").stamps, a.stamps, rtol=0, atol=0)
    write("g2o", tmp_path / "c.g2o", poses[::2], None, False)
    keyframes = cairn.read(tmp_path / "c.g2o")
    with pytest.raises(cairn.Error, match=r"pose k is compared with row k.*set the stamps of the estimate"):
        cairn.evaluate(keyframes, a)
    keyframes.stamps = a.stamps[::2]
    assert cairn.evaluate(keyframes, a).poses == 4
    assert_allclose(evaluated(keyframes, a)[1:], 0, atol=1e-9)
    for wrong in [[1.0], [4.0, 3, 2, 1], [1.0, 2, 3, np.nan]]:
        with pytest.raises(cairn.Error, match="expected 4 finite numbers that do not fall"):
            keyframes.stamps = wrong


def test_a_scale_that_explains_the_error_is_warned_of():
    rng = np.random.default_rng(8)
    poses = drive(rng, 20, False)
    truth, small = cairn.Graph(), cairn.Graph()
    truth.add_variables(cairn.Pose3, np.arange(20), poses)
    small.add_variables(cairn.Pose3, np.arange(20), np.column_stack([poses[:, :3] / 2.5, poses[:, 3:]]))
    with pytest.warns(UserWarning, match=r"a scale of 2.5 explains most .* align_scale=True"):
        cairn.evaluate(small, truth)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert_allclose(found(cairn.evaluate(small, truth, align_scale=True)), [2.5] + 6 * [0], atol=1e-9)
