# SPDX-License-Identifier: BSD-3-Clause
"""Floors and exploration, against the program."""
import importlib.util
import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

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
    assert_array_equal(result.steps["truth"][0], [0, 0, 0])
    assert_array_equal(result.start.state, [0, 3, 0])
    with pytest.raises(ZeroDivisionError):
        cairn.explore(room(), callback=lambda step: 1 / 0)


def test_options_and_names_are_checked_with_advice():
    for options, message in [
        (dict(explorer="frontiers"), "did you mean 'frontier'"),
        (dict(max_distance=0), "max_distance: expected a number above zero"),
        (dict(max_steps=-3), "max_steps: expected a whole number above zero"),
        (dict(explorer="frontier", lenght=2), "length"),
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


# Explorers written in Python ----------------------------------------------------------------------


def nearest_frontier():
    path = Path(__file__).resolve().parents[2] / "examples" / "python" / "nearest_frontier.py"
    spec = importlib.util.spec_from_file_location("nearest_frontier", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.NearestFrontier


def same_runs(one, other):
    return one.steps.keys() == other.steps.keys() and all(
        np.array_equal(one.steps[name], other.steps[name], equal_nan=True) for name in one.steps)


def test_an_explorer_of_ones_own_sees_the_whole_floor_and_the_same_seed_gives_the_same_run():
    floor = cairn.generate_floor("rooms", seed=3, width=8, height=6)
    runs = [cairn.explore(floor, nearest_frontier()(), seed=seed) for seed in [2, 2, 3]]
    for run in runs:
        assert run.end == "finished" and run.why.startswith("no frontier of 0.5 m"), run.why
        assert run.measures["seen"] > 0.95 * cairn.explore(floor, "frontier", seed=2).measures["seen"]
    assert same_runs(runs[0], runs[1]) and not same_runs(runs[0], runs[2])
    assert_array_equal(runs[0].map.cells, runs[1].map.cells)


def test_it_is_begun_with_the_seed_and_asked_after_each_motion():
    class Impatient:
        asked = 0

        def begin(self, seed):
            self.seed = seed

        def decide(self, situation):
            self.decision = situation.decision
            return cairn.Decision.drive([2.5, 1.5], "to the other corner") if situation.decision < 3 else cairn.Decision.stuck("enough")

        def is_worthwhile(self, situation, path):
            self.asked += 1
            assert path.length > 0 and situation.free.any()
            return False

    explorer = Impatient()
    # A match that moves the robot by more than a cell has it decide anew unasked.
    run = cairn.explore(room(), explorer, seed=7, start=Pose2(0, 3, 0), match_consecutive=False)
    assert (explorer.seed, explorer.asked, explorer.decision) == (7, 3, 3)
    assert (run.end, run.why) == ("stuck", "enough")
    assert len(run.decision_seconds) == 4 and run.steps["step"][-1] == 3  # each path was left after one motion


@pytest.mark.parametrize("returned, goes_on", [(True, True), (np.bool_(False), False), (0, False)])
def test_what_is_worthwhile_returns_is_a_truth_value(returned, goes_on):
    class Explorer:
        def decide(self, situation):
            self.decision = situation.decision
            return cairn.Decision.drive([2.5, 1.5]) if situation.decision < 2 else cairn.Decision.stuck("enough")

        def is_worthwhile(self, situation, path):
            self.asked = getattr(self, "asked", 0) + 1
            return returned

    explorer = Explorer()
    assert cairn.explore(room(), explorer, seed=7, start=Pose2(0, 3, 0), match_consecutive=False).end == "stuck"
    assert (explorer.asked == explorer.decision) != goes_on


@pytest.mark.parametrize("returned, name", [(None, "NoneType"), ("no", "str")])
def test_what_else_it_returns_is_refused(returned, name):
    class Explorer:
        def decide(self, situation):
            return cairn.Decision.drive([2.5, 1.5])

        def is_worthwhile(self, situation, path):
            return returned

    with pytest.raises(TypeError, match=f"is_worthwhile returned: expected True or False, not a value of type {name}"):
        cairn.explore(room(), Explorer(), seed=7, start=Pose2(0, 3, 0))


def test_a_path_without_points_is_refused():
    with pytest.raises(cairn.Error, match="Decision.drive: the path has no points"):
        cairn.explore(room(), lambda situation: cairn.Decision.drive(np.zeros((0, 2))), start=Pose2(0, 3, 0))


def test_the_situation_has_the_map_and_how_certain_the_poses_are():
    seen = {}

    def decide(situation):
        if situation.decision == 0:
            return cairn.Decision.drive([[1.0, -0.4], [2.4, -0.4]], look_at=[2.4, 1.0])  # below the wall in the middle
        seen.update({name: getattr(situation, name) for name in
                     ["pose", "poses", "free", "occupied", "log_odds", "clearance", "caution", "resolution", "radius", "frontiers"]})
        seen["states"], seen["graph"] = situation.states(Pose2), situation.graph()
        seen["covariance"] = situation.covariance(situation.poses)
        row, column = situation.cells_at(situation.pose.state[:2])
        assert situation.free[row, column]
        assert_array_equal(situation.cells_at(situation.centres([row, column])), [row, column])
        assert situation.path_to([0.0, 0.0]).points.shape[1] == 2
        assert situation.path_to([50.0, 0.0]) is None
        seen["situation"] = situation
        return cairn.Decision.finished("seen")

    run = cairn.explore(room(), decide, seed=4, start=Pose2(0, 3, 0))
    assert run.end == "finished" and run.why == "seen"
    assert_array_equal(run.steps["estimate"][-1], seen["pose"].state)
    # It has driven along the path, past its corner, and looks where it shall.
    assert np.hypot(*(seen["pose"].state[:2] - [2.4, -0.4])) < 0.1 and abs(seen["pose"].theta - np.pi / 2) < 0.1
    assert np.linalg.norm(run.steps["estimate"][:, :2] - [1.0, -0.4], axis=1).min() < 0.3
    cells = run.map.cells  # the same, as the run has left it
    assert cells.shape == seen["free"].shape == seen["log_odds"].shape == seen["clearance"].shape
    assert_array_equal(cells == -1, ~(seen["free"] | seen["occupied"]))
    per_cent = 100 / (1 + np.exp(-seen["log_odds"].astype(float)))
    known = cells >= 0
    assert np.abs(per_cent[known] - cells[known]).max() <= 0.51  # rounded
    assert not (seen["free"] & seen["occupied"]).any()
    # Clearance is the distance to the nearest cell that is not free, or less, where a beam ends in a free cell.
    free, other = np.argwhere(seen["free"]), np.argwhere(~seen["free"])
    border = np.pad(other, 0)
    distance = np.sqrt(((free[:, None] - border[None]) ** 2).sum(-1).min(1)) * seen["resolution"]
    assert (seen["clearance"][tuple(free.T)] <= distance + 1e-4).all()
    assert (seen["caution"] <= seen["clearance"]).all()
    for frontier in seen["frontiers"]:
        rows, columns = frontier.cells.T
        assert seen["free"][rows, columns].all() and abs(frontier.length - len(rows) * seen["resolution"]) < 1e-9
    # Poses and covariances, against those of the graph.
    assert_array_equal(seen["states"], seen["graph"].states(Pose2))
    assert seen["covariance"].shape == (len(seen["poses"]), 3, 3)
    expected = cairn.marginals(seen["graph"], seen["poses"][1:])  # the estimator's are at an earlier linearisation
    assert_allclose(seen["covariance"][1:], expected, rtol=0, atol=0.02 * np.abs(expected).max())
    for use in [lambda s: s.free, lambda s: s.pose, lambda s: s.covariance(0), lambda s: s.path_to([0, 3])]:
        with pytest.raises(cairn.Error, match="until the call that it was given to has returned"):
            use(seen["situation"])


def test_what_an_explorer_raises_reaches_the_caller():
    def fails(situation):
        raise ZeroDivisionError("in decide")

    with pytest.raises(ZeroDivisionError, match="in decide"):
        cairn.explore(room(), fails)
    for returned, message in [
        (None, "what the explorer returned is a NoneType; expected cairn.Decision.drive, finished or stuck"),
        (cairn.Decision.drive(None), "None is no path; Situation.path_to returns it where there is none"),
        (cairn.Decision.drive([90.0, 90.0]), r"no path to \(90, 90\)"),
        (cairn.Decision.drive([1.0, 2.0, 3.0]), r"the shape is \(3,\), expected \(2,\) or \(n, 2\)"),
        (cairn.Decision.drive([[1.0, np.nan]]), "a number that is not finite"),
    ]:
        with pytest.raises(cairn.Error, match=message):
            cairn.explore(room(), lambda situation: returned)
    with pytest.raises(cairn.Error, match="explorer: expected the name of one, a function"):
        cairn.explore(room(), 3)
    with pytest.raises(cairn.Error, match="an object .not its class. with such a method"):
        cairn.explore(room(), nearest_frontier())
    with pytest.raises(cairn.Error, match="explore has no argument 'smallest', and options are of explorers by name"):
        cairn.explore(room(), nearest_frontier()(), smallest=2)


def test_an_explorer_that_leads_nowhere_is_stuck():
    def stay(situation):
        return cairn.Decision.drive(np.array([[situation.pose.x, situation.pose.y]]))

    run = cairn.explore(room(), stay)
    assert (run.end, run.why) == ("stuck", "3 decisions in a row led to no motion")


def test_ctrl_c_within_a_decision_ends_the_run():
    run = """
        import os, signal, time
        import cairn
        signal.signal(signal.SIGINT, signal.default_int_handler)
        def decide(situation):
            if situation.decision < 2:
                return cairn.Decision.drive([situation.pose.state[:2] + [0.3, 0.0]], "on")
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(30)
        result = cairn.explore(cairn.generate_floor("rooms", seed=3), decide)
        assert result.end == "interrupted", result
        print("went on")
    """
    ended = subprocess.run([sys.executable, "-c", textwrap.dedent(run)], capture_output=True, text=True, timeout=120)
    assert (ended.returncode, ended.stdout) == (0, "went on\n"), ended.stderr


def test_a_floor_goes_by_its_name(tmp_path):
    room().write(tmp_path / "floor.yaml")
    for floor in [tmp_path / "floor.yaml", str(tmp_path / "floor.yaml")]:
        assert_array_equal(cairn.explore(floor, max_steps=2).steps["coverage"], cairn.explore(room(), max_steps=2).steps["coverage"])
    named, made = cairn.explore("@rooms:width=12,seed=3", max_steps=2), cairn.explore(cairn.generate_floor("rooms", seed=3, width=12), max_steps=2)
    assert_array_equal(named.steps["coverage"], made.steps["coverage"])
    with pytest.raises(cairn.Error, match="there is no file 'rooms'; '@rooms' makes that floor plan"):
        cairn.explore("rooms")
    with pytest.raises(TypeError, match="floor: expected a cairn.Floor, the name of a file .* or a floor plan such as '@rooms', not a int"):
        cairn.explore(3)


@pytest.mark.parametrize("name", ["until", "lidar"])
def test_an_option_that_nothing_has_is_answered_by_the_arguments(name):
    with pytest.raises(cairn.Error, match=f"explore has no argument '{name}', nor has drrt_star such an option; arguments: floor, .*max_distance.*world.*options: "):
        cairn.explore(room(), **{name: "x"})
