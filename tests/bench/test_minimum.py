# SPDX-License-Identifier: BSD-3-Clause
"""The study of the time to the minimum, of made-up reports."""
import math
import sys
import tempfile
import unittest
from pathlib import Path

from bench.data_sets import pose_graphs
from bench.program import Cairn
from bench.study import Bench
from bench.studies import minimum
from reports_of import report, section


def optimized(chi2s, status="converged", total=1.0, step=0.1, guess=0.5):
    """The report of a run: from the first chi2 on, an iteration each."""
    return {"status": status, "chi2": {"initial": chi2s[0], "final": min(chi2s)}, "seconds": {"total": total, "initial": guess},
            "iterations": [{"chi2": chi2, "seconds": step} for chi2 in chi2s[1:]]}


def contestant(name, *reports):
    return {"name": name, "in_time": True, "limit": 60, "runs": [minimum.summary_of(one) for one in reports]}


def start(name, chi2, contestants, **more):
    return {"name": name, "chi2": chi2, "notes": [], "contestants": contestants, **more}


def town():
    """The default reaches the minimum 10 in 0.9 s, dogleg in 0.45 s; Ceres stops above it from a spanning tree."""
    runs = [contestant("levenberg_marquardt", optimized([900.0, 50.0, 10.000001, 10.0])),
            contestant("dogleg", optimized([900.0, 10.0], total=0.45))]
    ceres = contestant("ceres", optimized([900.0, 12.5]))
    lost = contestant("gauss_newton", optimized([900.0, 20.0], "max_iterations"))
    auto = start("auto", 11.0, [contestant("levenberg_marquardt", optimized([11.0, 10.0], total=0.2, guess=0.8))],
                 ) | {"notes": ["chordal (chi2 11); not as_given (chi2 900)"]}
    return {"name": "town", "generated": False, "graph": {"variables": 100, "factors": 200},
            "starts": [start("as_given", 900.0, runs, also="odometry"), start("spanning_tree", 900.0, [*runs, ceres, lost]), auto]}


class CurveTest(unittest.TestCase):
    def test_what_is_in_no_iteration_counts_as_before_the_first(self):
        self.assertEqual(minimum.curve_of(optimized([9.0, 5.0, 4.0], total=0.5)), [[9.0, 0.3], [5.0, 0.4], [4.0, 0.5]])

    def test_the_minimum_is_reached_where_chi2_is_first_low_enough(self):
        run = minimum.summary_of(optimized([9.0, 5.0, 7.0, 4.0, 4.0], total=1.0))
        self.assertEqual([round(value, 9) for value in minimum.reached(run, 5.0)], [0.7, 1.0])
        self.assertEqual([round(value, 9) for value in minimum.reached(run, 4.9)], [0.9, 3.0])
        self.assertTrue(all(map(math.isnan, minimum.reached(run, 3.9))))
        self.assertEqual(minimum.reached(run, 9.0), (run["curve"][0][1], 0.0))

    def test_a_chi2_that_is_no_number_is_not_the_minimum(self):
        run = {"curve": [[None, 0.1], [4.0, 0.2]]}
        self.assertEqual(minimum.reached(run, 5.0), (0.2, 1.0))

    def test_times_are_medians_of_the_runs_that_reached_it(self):
        runs = [minimum.summary_of(optimized([9.0, 4.0], total=total)) for total in [1.0, 2.0, 7.0]]
        lost = minimum.summary_of(optimized([9.0, 8.0]))
        self.assertEqual(minimum.times_of({"runs": [*runs, lost]}, 4.0), (2.0, 1.0))


class MinimumTest(unittest.TestCase):
    def test_the_lowest_chi2_of_all_is_the_minimum_up_to_a_millionth(self):
        self.assertEqual(minimum.lowest(town()), 10.0)
        self.assertAlmostEqual(minimum.bound(town()), 10.00001, delta=1e-12)

    def test_where_chi2_goes_to_zero_rounding_of_the_start_counts(self):
        entry = {"starts": [start("as_given", 1e4, [contestant("dogleg", optimized([1e4, 3e-20]))])]}
        self.assertAlmostEqual(minimum.bound(entry), 1e-8, delta=1e-15)

    def test_times_iterations_and_other_minima_are_told_apart(self):
        table = section(report("minimum", town()), "minimum")
        self.assertIn("| town | as_given, odometry | 500 | 900 (2) | 450 (1) | - | - |\n", table)
        self.assertIn("| 900 (2) | 450 (1) | other minimum: 12.5 | not reached: 20 |\n", table)
        self.assertNotIn("auto", table)

    def test_each_start_counts_how_often_the_minimum_is_reached(self):
        table = section(report("minimum", town()), "minimum-summary")
        self.assertIn("| as_given | 1 of 1, 1.00 × | 1 of 1, 0.500 × | 0 of 0, - | 0 of 0, - |\n", table)
        self.assertIn("| odometry | 1 of 1, 1.00 × |", table)
        self.assertIn("| spanning_tree | 1 of 1, 1.00 × | 1 of 1, 0.500 × | 0 of 1, - | 0 of 1, - |\n", table)

    def test_the_automatic_start_is_compared_with_the_fastest_way(self):
        table = section(report("minimum", town()), "minimum-auto")
        self.assertIn("| town | 100 | 200 | 10 | chordal | 800 | 200 (1) | 80 % | 950 | as_given, dogleg | 1.05 |\n", table)


class PeerTest(unittest.TestCase):
    def test_a_peer_has_a_name_and_a_command(self):
        self.assertEqual(minimum.Peer.of("g2o LM=run 'a b' lm"), minimum.Peer("g2o LM", ["run", "a b", "lm"]))
        for wrong in ["g2o", "=run", "g2o= "]:
            with self.assertRaisesRegex(ValueError, "NAME=COMMAND"):
                minimum.Peer.of(wrong)

    def test_a_peer_gets_the_states_of_the_start_and_its_report_is_read(self):
        """A program that stands for cairn and for the peer alike."""
        with tempfile.TemporaryDirectory() as place:
            program = Path(place) / "program"
            program.write_text(f"#!{sys.executable}\nimport json, pathlib, sys\n"
                               "if '-o' in sys.argv: pathlib.Path(sys.argv[sys.argv.index('-o') + 1]).write_text('states')\n"
                               "peer = sys.argv[1] == 'peer'\n"
                               "assert not peer or pathlib.Path(sys.argv[2]).read_text() == 'states'\n"
                               f"print(json.dumps({optimized([9.0, 4.0])!r} | {{'graph': {{}}, 'initial_notes': [], "
                               "'status': 'peer' if peer else 'cairn'}))\n", encoding="utf-8")
            program.chmod(0o755)
            kept = []
            bench = Bench(Cairn(str(program), Path(place) / "work"), quick=True, peers=[f"other={program} peer"])
            minimum.study_minimum(bench, kept.append)
        self.assertEqual([one["name"] for one in kept], [data.name for data in pose_graphs(None, True)])
        # Odometry is the same start here; from the automatic one only the default runs.
        ran = [(one["name"], [(each["name"], each["runs"][0]["status"]) for each in one["contestants"]]) for one in kept[0]["starts"]]
        everybody = [*((name, "cairn") for name in minimum.OPTIMIZERS), ("other", "peer")]
        self.assertEqual(ran, [("as_given", everybody), ("spanning_tree", everybody), ("chordal", everybody),
                               ("auto", [("levenberg_marquardt", "cairn")])])


class PoseGraphsTest(unittest.TestCase):
    def test_every_file_of_the_two_folders_is_a_graph(self):
        with tempfile.TemporaryDirectory() as place:
            for name in ["pose2d/b.g2o", "pose2d/A.graph.gz", "pose3d/c.g2o", "ba/d.txt"]:
                (Path(place) / name).parent.mkdir(exist_ok=True)
                (Path(place) / name).touch()
            sets = pose_graphs(Path(place), False)
        self.assertEqual([(one.name, "slam3d:metric=g2o" in one.arguments) for one in sets][:4],
                         [("A.graph", False), ("b.g2o", False), ("c.g2o", True), ("manhattan", False)])
