# SPDX-License-Identifier: BSD-3-Clause
"""The programs of examples/python, on logs made here and, where they are, on real ones."""
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import cairn
import dense

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "python"


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def simulate(folder, rows=400, seed=0):
    """Logs of a robot on a figure of eight among three beacons; every twentieth range is reflected."""
    random = np.random.default_rng(seed)
    times = 0.2 * np.arange(rows + 1)
    turn, step = 0.05 * np.sin(2 * np.pi * np.arange(rows) / 200), np.full(rows, 0.25)
    truth = [np.array([0.0, 0.0, 0.4])]
    for k in range(rows):
        truth.append(dense.compose(truth[-1], np.array([step[k], 0, turn[k]])))
    truth = np.array(truth)
    beacons = np.array([[0, 3.0, 12.0], [1, 20.0, -8.0], [7, -10.0, -5.0]])
    heard = np.arange(5, rows, 2)
    receiver = random.integers(0, 3, size=len(heard))
    distance = np.hypot(*(beacons[receiver, 1:] - truth[heard, :2]).T) + random.normal(scale=0.3, size=len(heard))
    distance = np.abs(distance)
    distance[::20] += 12
    noisy = [step + random.normal(scale=0.02, size=rows), turn + random.normal(scale=0.01, size=rows)]
    np.savetxt(folder / "odometry.txt", np.column_stack([times[1:], *noisy]))
    np.savetxt(folder / "ranges.txt", np.column_stack([times[heard] + 0.05, 0 * heard + 2, beacons[receiver, 0], distance]))
    np.savetxt(folder / "truth.txt", np.column_stack([times, truth]))
    np.savetxt(folder / "beacons.txt", beacons)
    return folder


def check_ranges(folder):
    ranges = example("ranges")
    results = []
    for native in [False, True]:
        graph, true = ranges.build(folder, native)
        before = cairn.evaluate(graph, true).ate_translation
        summary = cairn.optimize(graph, initial=None)
        results.append((summary.chi2, before, cairn.evaluate(graph, true).ate_translation))
        assert summary.converged and not any("Jacobian" in note for note in summary.notes)
    assert_allclose(results[0], results[1], rtol=1e-6)
    return results[0]


def test_ranges_correct_dead_reckoning(tmp_path):
    _, before, after = check_ranges(simulate(tmp_path))
    assert after < 0.5 * before


@pytest.mark.skipif("CAIRN_DATA" not in os.environ, reason="CAIRN_DATA=FOLDER would test it on real logs")
def test_ranges_of_plaza_1():
    _, before, after = check_ranges(Path(os.environ["CAIRN_DATA"]) / "sensors" / "plaza1")
    assert before > 1.4 and after < 1.2  # [m]


def test_ranges_is_a_program(tmp_path):
    ended = subprocess.run([sys.executable, EXAMPLES / "ranges.py", simulate(tmp_path)], capture_output=True, text=True)
    assert ended.returncode == 0 and "converged, chi2" in ended.stdout, ended.stdout + ended.stderr


def test_nearest_frontier_is_a_program():
    ended = subprocess.run([sys.executable, EXAMPLES / "nearest_frontier.py", "--seed", "2"], capture_output=True, text=True)
    assert ended.returncode == 0 and ended.stdout.startswith("finished: no frontier of 0.5 m"), ended.stdout + ended.stderr
    assert len((EXAMPLES / "nearest_frontier.py").read_text().splitlines()) < 60
