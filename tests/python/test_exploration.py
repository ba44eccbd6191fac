# SPDX-License-Identifier: BSD-3-Clause
"""Floors and exploration, against the program."""
import json
import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import cairn
from cairn import Pose2



def room():
    """4 m x 3 m inside walls, cells of 0.1 m."""
    cells = np.zeros((32, 42), dtype=int)
    cells[[0, -1], :] = 100
    cells[:, [0, -1]] = 100
    cells[12:14, 20:30] = 100
    return cairn.Floor(cells, 0.1, origin=[-1.0, 2.0, 0.0])


def test_it_does_what_the_program_does(tmp_path):
    room().write(tmp_path / "floor.yaml")
    command = [os.environ["CAIRN_PROGRAM"], "explore", "floor.yaml", "--until", "distance=6", "--seed", "5", "--json", "run.json"]
    subprocess.run(command + ["-o", "graph.g2o", "--map", "map.yaml", "--quiet"], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    report = json.loads((tmp_path / "run.json").read_text())
    result = cairn.explore(cairn.read_floor(tmp_path / "floor.yaml"), seed=5, max_distance=6)
    assert (result.end, result.why) == (report["end"], report["why"])
    steps = result.steps
    assert steps["distance"][-1] == report["distance"] and steps["step"][-1] == report["motions"]
    for name in ["distance", "coverage", "map_entropy", "trajectory_entropy", "loops"]:
        expected = [np.nan if step[name] is None else step[name] for step in report["steps"]]
        assert_array_equal(steps[name], expected, name)
    numbers = {name: value for name, value in result.measures.items() if name in report["measures"]}
    assert numbers.keys() == report["measures"].keys()
    for name, value in report["measures"].items():
        assert_array_equal(numbers[name], np.nan if value is None else value, name)
    written = cairn.read(tmp_path / "graph.g2o")
    assert_array_equal(result.graph.states(Pose2), written.states(Pose2))
    result.map.write(tmp_path / "own.yaml")
    assert (tmp_path / "own.png").read_bytes() == (tmp_path / "map.png").read_bytes()
    assert result.map.origin == cairn.read_floor(tmp_path / "map.yaml").origin
    assert result.trajectory.variable_count == len(steps["step"]) == result.truth.variable_count
    assert_allclose(result.measures["ate"], cairn.evaluate(result.trajectory, result.truth).ate_translation, rtol=1e-12)
    assert len(result.decision_seconds) == result.measures["decisions"] and result.converged


def test_a_recorded_robot_is_refused(tmp_path):
    room().write(tmp_path / "floor.yaml")
    command = [os.environ["CAIRN_PROGRAM"], "explore", "floor.yaml", "--until", "steps=3", "--log", "run.clf", "--quiet"]
    subprocess.run(command, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    with pytest.raises(cairn.Error, match="cairn explore --world log"):
        cairn.explore(room(), world=f"log:file={tmp_path / 'run.clf'}")


def test_a_callback_sees_each_motion_and_may_end_it():
    seen = []
    result = cairn.explore(room(), start=Pose2(0, 3, 0), callback=lambda step: seen.append(step) or step.step < 5)
    assert [step.step for step in seen] == [1, 2, 3, 4, 5] or [step.step for step in seen] == [0, 1, 2, 3, 4, 5]
    assert result.end == "interrupted"
    assert_array_equal(result.steps["estimate"][-1], seen[-1].estimate.state)
    assert_array_equal(result.steps["truth"][0], [0, 3, 0])
    with pytest.raises(ZeroDivisionError):
        cairn.explore(room(), callback=lambda step: 1 / 0)


def test_options_and_names_are_checked_with_advice():
    for options, message in [
        (dict(explorer="frontiers"), "did you mean 'frontier'"),
        (dict(max_distance=0), "max_distance: expected a number above zero"),
        (dict(max_steps=-3), "max_steps: expected a whole number above zero"),
        (dict(lenght=2), "length"),
        (dict(start=Pose2(50, 50, 0)), "50"),
        (dict(world="lidar_building:rnge=3"), "range"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            cairn.explore(room(), **options)


def test_floors_are_arrays(tmp_path):
    floor = room()
    assert floor.cells.dtype == np.int8 and floor.cells.shape == (32, 42)
    assert floor.origin == (-1.0, 2.0, 0.0) and repr(floor) == "<cairn.Floor: 42 x 32 cells of 0.1 m>"
    assert floor.cells[0, 0] == 100 and floor.cells[5, 5] == 0 and floor.cells[12, 25] == 100
    floor.write(tmp_path / "floor.yaml")
    again = cairn.read_floor(tmp_path / "floor.yaml")
    assert_array_equal(again.cells, floor.cells)
    assert again.origin == floor.origin
    with pytest.raises(cairn.Error, match="neither per cent"):
        cairn.Floor([[0, 101]], 0.1)
    with pytest.raises(cairn.Error, match=r"expected \(rows, columns\)"):
        cairn.Floor([0, 1], 0.1)
    with pytest.raises(cairn.Error, match="resolution"):
        cairn.Floor([[0, 1]], 0.0)
    assert_array_equal(cairn.generate_floor("rooms", seed=3).cells, cairn.generate_floor("rooms", seed=3).cells)
    with pytest.raises(cairn.Error, match="did you mean 'rooms'"):
        cairn.generate_floor("room")


def test_ctrl_c_ends_it_with_the_map_so_far():
    run = """
        import os, signal
        import numpy as np
        import cairn
        signal.signal(signal.SIGINT, signal.default_int_handler)
        floor = cairn.generate_floor("rooms", seed=3)
        def press(step):
            if step.step == 4:
                os.kill(os.getpid(), signal.SIGINT)
        result = cairn.explore(floor, callback=press)
        assert result.end == "interrupted" and 4 <= result.steps["step"][-1] <= 5, result
        assert (result.map.cells >= 0).any()
        print("went on")
    """
    ended = subprocess.run([sys.executable, "-c", textwrap.dedent(run)], capture_output=True, text=True, timeout=120)
    assert (ended.returncode, ended.stdout) == (0, "went on\n"), ended.stderr


@pytest.mark.parametrize("cells", [np.array([[0, 0.7, 1.0]]), np.array([[False, True]]), np.array([[2**64 - 1]], dtype=np.uint64)])
def test_a_floor_is_of_integers(cells):
    with pytest.raises(cairn.Error, match="cells: "):
        cairn.Floor(cells, 0.1)
