# SPDX-License-Identifier: BSD-3-Clause
"""Tables and pictures of docs/compact_results.md, of made-up reports; planar poses and the published figures."""
import json
import math
import unittest

import numpy as np

from bench.published import said
from bench.studies.compact.million import chained, compose, planar_error
from bench.studies.compact.recoveries import poses_of, position, widest_stretch
from bench.studies.compact.runs import planar_truth
from reports_of import report, section, studies


def run(seconds, poses, loops, error, **more):
    """A run that kept a part of 100 poses and 200 loops; all errors follow from one."""
    errors = {kind: {"translation": error, "rotation": 2.0 * error} for kind in ["ate", "rpe", "rpe_all"]}
    return {"poses": {"in": 100, "kept": poses},
            "loops": {"in": 200, "kept": loops, "registered": 90, "false_registered": 9, "false_kept": 3},
            "seconds": {"total": seconds}, "steps": {"p99": 0.001}, "nonzeros": {"information": 5000, "factor": 7000},
            "errors": {"v2": errors, "likely": errors}, "peak_memory_bytes": 2e7, "verdicts": {}, **more}


def contestant(name, *runs, **more):
    return {"name": name, "in_time": bool(runs), "limit": 300, "runs": list(runs), **more}


def thresholds(loop_gain):
    options = {"range": "2.5", "angle": "0.25", "probability": "0.1", "pose_gain": "5.75", "loop_gain": str(loop_gain)}
    return {"options": options, "trials": [{}, {}], "seconds": 0.5}


APAL = [run(4.0, 100, 200, 0.2), run(12.0, 100, 200, 0.2)]


def sets_report(name, apal, de_facto=False):
    return report("compact_sets", {
        "name": name, "de_facto": de_facto, "found": thresholds(3.5), "by_rule": thresholds(7.0),
        "contestants": [
            contestant("apal", run(20.0, 100, 200, 0.2)), contestant("tested", *apal),
            contestant("fpfl", run(0.5, 20, 10, 0.3), run(1.0, 20, 10, 0.3)),
            contestant("by_rule", run(0.25, 10, 5, 0.4)),
            contestant("random", run(1.0, 20, 10, 0.6), run(1.0, 20, 10, 1.2), run(1.0, 20, 10, 9.0), converged=3),
            contestant("random_poses", run(1.0, 20, 8, 0.9), run(1.0, 20, 8, 0.9), converged=1)]})


class SetsTest(unittest.TestCase):
    def test_thresholds_are_put_beside_the_papers(self):
        self.assertIn("| parking-garage | the paper's | 95.0 | 1.10 | 0.100 | 5.77 | 2.45 |  |  |\n"
                      "|  | by the rule | 2.50 | 0.250 | 0.100 | 5.75 | 7.00 | 2 | 0.500 |\n"
                      "|  | found | 2.50 | 0.250 | 0.100 | 5.75 | 3.50 |",
                      section(sets_report("parking-garage", APAL), "compact-thresholds"))

    def test_times_are_paired_within_a_round(self):
        text = section(sets_report("parking-garage", APAL), "compact-times")
        self.assertIn("| parking-garage | 100 | 200 | found | 8.00 | 0.750 | 10.0 × | 5.0 % | 20.0 % | 1.00 | 1.00 |\n", text)
        self.assertIn("|  |  |  | the paper's | 103 | 30.6 | 3.37 × | 20.9 % | 64.3 % |", text)

    def test_all_poses_and_loops_took_too_long(self):
        self.assertIn("| town | 100 | 200 | found | > 300 | 0.750 | > 400 × |",
                      section(sets_report("town", []), "compact-times"))

    def test_errors_over_those_of_everything_and_of_the_same_size_at_random(self):
        text = section(sets_report("parking-garage", APAL, True), "compact-errors")
        self.assertIn("| parking-garage † | APAL | 0.200 | 0.400 |", text)
        self.assertIn("|  | APAL, distance test | 0.200 | 0.400 | 0.200 | 0.400 | 0.200 | 0.400 | 1.00 × |  |\n", text)
        self.assertIn("|  | FPFL | 0.300 | 0.600 | 0.300 | 0.600 | 0.300 | 0.600 | 1.50 × |  |\n", text)
        self.assertIn("|  | RFPFL, loops first | 1.20 | 2.40 | 1.20 | 2.40 | 1.20 | 2.40 | 6.00 × | 4.00 × |\n", text)
        self.assertIn("|  | RFPFL, poses first | 0.900 | 1.80 | 0.900 | 1.80 | 0.900 | 1.80 | 4.50 × | 3.00 × |\n", text)

    def test_the_papers_errors_have_all_to_all_as_it_should_be(self):
        text = section(sets_report("parking-garage", APAL, True), "compact-errors")
        self.assertIn("|  | the paper's APAL | 0.193 | 0.787 | 0.0160 | 0.270 | 3.62 | 1.10 |  |  |\n", text)
        self.assertIn("|  | the paper's FPFL | 0.661 | 0.757 | 0.0120 | 0.109 | 1.65 | 0.915 | 3.42 × |  |\n", text)
        self.assertIn("|  | the paper's RFPFL | 6.20 | 9.76 | 0.247 | 1.69 | 14.0 | 10.3 | 32.1 × | 9.38 × |\n", text)

    def test_how_many_of_the_controls_have_converged(self):
        text = section(sets_report("town", APAL), "compact-control")
        self.assertIn("| town | loops | 20 | 10 | 10 | 3 of 3 | 2.00 × | 4.00 × | 30.0 × |\n", text)
        self.assertIn("|  | poses | 20 | 8 | 10 | 1 of 2 | 3.00 × | 3.00 × | 3.00 × |\n", text)

    def test_ways_of_recovery_are_compared_with_the_papers_table(self):
        text = section(sets_report("kitti_00", APAL), "compact-recovery")
        self.assertIn("| kitti_00 | v0 | - |", text)
        self.assertIn("|  | v2 | 0.400 | 0.800 | 0.400 | 0.800 | 0.400 | 0.800 |\n", text)
        self.assertIn("|  | the paper's v2 | 3.09 | 2.25 | 0.0290 | 0.119 | 10.3 | 3.14 |", text)
        self.assertNotIn("paper's", section(sets_report("town", APAL), "compact-recovery"))

    def test_the_papers_rows_are_left_out_for_other_graphs(self):
        whole = sets_report("town", APAL)
        self.assertIn("| 6.00 × | 4.00 × |\n", section(whole, "compact-errors"))
        for name in ["compact-errors", "compact-times", "compact-thresholds"]:
            self.assertNotIn("paper's", section(whole, name))

    def test_a_graph_that_is_simulated_after_the_papers_has_its_rows(self):
        self.assertIn("the paper's RFPFL", section(sets_report("kitti_00, simulated", APAL), "compact-errors"))


class SensitivityTest(unittest.TestCase):
    @staticmethod
    def gains(exact):
        return report("compact_gain", {"name": "town", "apal": run(9.0, 100, 200, exact), "runs": [
            {"factor": 0, "loop_gain": 0, "run": run(8.0, 100, 180, exact)},
            {"factor": 0.707, "loop_gain": 3.5, "run": run(1.0, 100, 20, 0.5)}]})

    def test_loops_and_errors_against_the_threshold_on_their_gain(self):
        text = section(self.gains(0.2), "compact-gain")
        self.assertIn("| town | 0 | 0.00 | 180 | 90.0 % | 0.200 | 0.400 | 1.00 × |\n", text)
        self.assertIn("|  | 0.707 | 3.50 | 20 | 10.0 % | 0.500 | 1.00 | 2.50 × |\n", text)

    def test_the_curves_are_those_of_the_table(self):
        self.assertEqual(studies()["compact_gain"].files(self.gains(0.25)["entries"])["compact_gain.csv"],
                         'threshold over the rule\'s,"loop closures kept [%], town","ATE over that of APAL, town"\n'
                         "0.0,90.0,1.0\n0.707,10.0,2.0\n")

    def test_what_a_robot_has_live(self):
        kept = run(1.0, 25, 20, 0.5)
        kept["loops"]["proposed"] = 300
        live = report("compact_live", {"name": "town", "de_facto": True, "contestants": [
            contestant("fpfl", kept), contestant("apal"),
            contestant("random", run(1.0, 25, 20, 0.7), run(1.0, 25, 20, 0.9), run(1.0, 25, 20, 0.8))]})
        self.assertIn("| town † | 25 | 100 | 20 | 3.00 | 15.0 | 20 | 0.500 | 1.00 | - | - | 0.800 | 1.60 | - | - |\n",
                      section(live, "compact-live"))

    def test_a_robot_that_kept_no_loop_closure_has_no_ratio_to_that(self):
        live = report("compact_live", {"name": "town", "contestants": [contestant("fpfl", run(1.0, 25, 0, 0.5))]})
        self.assertIn("| town | 25 | 100 | 0 | - | - | 20 |", section(live, "compact-live"))

    def test_what_stands_beside_the_figures(self):
        figures = report("compact_figures", {"name": "town", "apal": run(9.0, 100, 200, 0.25), "apfl": run(8.0, 100, 20, 0.5),
                                             "fpfl": run(1.0, 30, 10, 0.75)})
        text = section(figures, "compact-figures")
        self.assertIn("| town | (a) all poses, all loop closures | 100 | 100.0 % | 200 | 100.0 % | 0.250 | 0.500 |\n", text)
        self.assertIn("|  | (c) few of both | 30 | 30.0 % | 10 | 5.0 % | 0.750 | 1.50 |\n", text)

    def test_recovered_paths_are_drawn_and_have_no_row(self):
        figures = report("compact_figures", {"part": "recoveries", "name": "town", "runs": {"v0": run(1.0, 30, 10, 0.75)}})
        self.assertNotIn("town", section(figures, "compact-figures"))

    def test_the_detail_is_where_paths_differ_most(self):
        straight = poses_of("\n".join(f"VERTEX_SE2 {k} {k} 0 0" for k in range(20)) + "\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n")
        bent = {k: f"VERTEX_SE2 {k} {k} {1.0 if k == 12 else 0.1} 0" for k in range(1, 20)}
        self.assertEqual(widest_stretch(straight, bent, 4), [10, 11, 12, 13])
        bent[19] = "VERTEX_SE2 19 19 -3 0"
        self.assertEqual(widest_stretch(straight, bent, 4), [16, 17, 18, 19])
        self.assertEqual(widest_stretch(straight, {}, 4), [])

    def test_how_far_poses_are_apart_is_of_all_coordinates_that_they_have(self):
        self.assertEqual(position("VERTEX_SE3:QUAT 7 1 2 3 0 0 0 1"), [1.0, 2.0, 3.0])
        self.assertEqual(position("VERTEX_SE2 7 1 2 3"), [1.0, 2.0])


def growth_report():
    """Quadratic for all, linear for few; all were late at the last."""
    return report("compact_growth", {"part": "thresholds"}, *({"part": "growth", "laps": n, "contestants": [
        contestant("tested", *([] if n == 20 else [run(n * n, 100, 200, 0.1)])), contestant("fpfl", run(n, 30, 10, 0.1))]}
        for n in [1, 5, 10, 20]))


class GrowthTest(unittest.TestCase):
    def test_the_growth_is_fitted_from_five_laps_on(self):
        text = section(growth_report(), "compact-growth")
        self.assertIn("| 10 | 100 | 200 | 100 | 10.0 | 30 | 10 | - | - | - |\n", text)
        self.assertIn("| 20 | 100 | 200 | > 300 | 20.0 |", text)
        self.assertIn("| 10 | 5 k | 7 k | 5 k | 7 k | - | - |\n", text)
        self.assertIn("APAL: time as N^2.00, nonzeros of L as N^0.00; FPFL: time as N^1.00", text.replace("N^-0.00", "N^0.00"))

    def test_a_line_for_each_strategy_that_was_in_time(self):
        files = studies()["compact_growth"].files(growth_report()["entries"])
        graphs = json.loads(files["compact_growth_picture.json"])["graphs"]
        self.assertEqual(len(graphs), 7)  # three of APAL, four of FPFL
        self.assertEqual(graphs[0]["graph"], {"file": "APAL", "variables": 100.0})

    def test_how_many_are_kept_after_many_laps_and_whether_steps_grow(self):
        text = section(report("compact_growth", {
            "part": "laps", "name": "by_rule", "laps": 200, "in_time": True, "limit": 120,
            "after": [{"laps": 10, "poses": 30, "loops": 40}, {"laps": 200, "poses": 33, "loops": 99}],
            "first_quarter": {"median": 0.001, "p99": 0.002}, "last_quarter": {"median": 0.003, "p99": 0.004},
            "run": {"seconds": {"total": 9}}}, {"part": "laps", "name": "fpfl", "laps": 200, "in_time": False, "limit": 120}),
            "compact-laps")
        self.assertIn("| FPFL as published | 10 | 30 | 40 |\n|  | 200 | 33 | 99 |\n", text)
        self.assertIn("| FPFL | 200 | not finished after 120 s | - |\n", text)
        self.assertIn("| FPFL as published | 9.00 | 1.00 | 2.00 | 3.00 | 4.00 |\n", text)


class ChecksTest(unittest.TestCase):
    def test_covariances_are_consistent_within_the_band_of_chi2(self):
        def entry(strategy, squared):
            return {"part": "nees", "name": "town", "strategy": strategy,
                    "runs": [{"squared": squared, "dof": 10000}, {"squared": 10000, "dof": 10000}, None]}
        text = section(report("compact_consistency", entry("fpfl", 8000), entry("apal", 10300), entry("apfl", 12000)),
                       "compact-nees")
        self.assertIn("| town | FPFL | 2 | 20000 | 0.9000 | 0.9804 … 1.0196 | conservative |\n", text)
        self.assertIn("| 1.0150 | 0.9804 … 1.0196 | consistent |\n", text)
        self.assertIn("| 1.1000 | 0.9804 … 1.0196 | overconfident |\n", text)

    def test_covariances_are_compared_with_those_of_everything(self):
        compared = {"steps": 166, "marginal_conservative": 0.995, "full_conservative": 1.0, "least_marginal_ratio": 0.99,
                    "least_full_ratio": 1.2, "least_eigenvalue": 0.987}
        text = section(report("compact_consistency", {"part": "compare", "name": "town", "compare": compared},
                              {"part": "compare", "name": "village", "compare": None}), "compact-compare")
        self.assertIn("| town | 166 | 99.5 % | 0.990 | 100.0 % | 1.20 | 0.987 |\n", text)
        self.assertIn("| village | - | - | - | - | - | - |\n", text)

    def test_refusals_are_zero_where_there_were_none(self):
        refusing = {"inconsistent": 7, "waiting": 2}
        text = section(report("compact_matches", {"name": "town", "false_rate": 0.1, "gate": 0.99, "contestants": [
            contestant("open, clean", run(1.0, 30, 40, 0.5)),
            contestant("gated, clean", run(1.0, 30, 40, 0.5, verdicts=refusing)), contestant("open, false")]}),
            "compact-matches")
        self.assertIn("| town | none | none | 90 | 9 | 40 | 3 | 0 | 0 | 30 | 0.500 | 1.00 × |\n", text)
        self.assertIn("|  | none | 0.99 | 90 | 9 | 40 | 3 | 7 | 2 | 30 |", text)
        self.assertIn("|  | 10 % | none | > 300 s | - |", text)


class SeedsTest(unittest.TestCase):
    RUNS = [{"apal": {"ate": 0.2}, "fpfl": {"ate": 0.3 + 0.1 * k}, "by_rule": {"ate": 0.3 * (k + 1)}} for k in range(10)]

    def test_the_papers_ratio_is_put_among_those_of_all_draws(self):
        text = section(report("compact_seeds", {"name": "ellipse3d", "runs": self.RUNS}), "compact-seeds")
        self.assertIn("| ellipse3d | APAL | 10 | 0.200 | 0.173 |", text)
        # Of ten values the second from either end; the paper has 0.338 m and 0.173 m.
        self.assertIn("|  | FPFL as published | 10 | 1.65 | 0.338 | 8.25 × | 3.00 … 13.5 | 4.50 … 12.0 | 1.50 … 15.0 | 1.95 × | 10 % |\n",
                      text)
        self.assertIn("|  | FPFL | 10 | 0.750 |  | 3.75 × | 2.00 … 5.50 |", text)


class MillionTest(unittest.TestCase):
    def test_there_is_a_row_for_each_stop(self):
        million = report("compact_million", {
            "part": "drive", "poses": 100000, "kept": 2000, "factors": 3600, "memory": 6.8e7, "median": 4e-5, "p99": 0.002,
            "longest": 0.03, "asked": 1.5, "left": 0.0123, "ate": 0.25, "ate_rotation": 0.01},
            {"part": "errors", "name": "live", "poses": 100000, "ate": 0.5, "ate_rotation": 0.0174533})
        self.assertIn("| 100000 | 2000 | 3600 | 68 | 0.0400 | 2.00 | 30.0 | 1.50 | 1.23 % | 0.250 |\n",
                      section(million, "compact-million"))
        self.assertIn("| compact, each pose when it was the newest | 100000 | 0.500 | 1.00 |\n",
                      section(million, "compact-million-errors"))

    def test_the_error_is_what_a_rigid_motion_leaves(self):
        truth = np.array([[math.cos(0.7 * k), 2.0 * math.sin(0.4 * k), 0.3 * k] for k in range(8)])
        estimate = compose(np.array([3.0, -2.0, 1.2]), truth)
        self.assertLess(max(planar_error(estimate, truth)), 1e-12)
        estimate[:, 2] += 0.1
        translation, rotation = planar_error(estimate, truth)
        self.assertLess(translation, 1e-12)
        self.assertAlmostEqual(rotation, 0.1, delta=1e-12)

    def test_no_rotation_beside_the_one_that_is_found_is_better(self):
        truth = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 1, 0.0]])
        estimate = np.array([[0.1, 0, 0], [0.9, 0.2, 0], [1.3, 2, 0], [-1, 0.7, 0]])
        errors = []
        for k in range(-3000, 3001):
            apart = compose(np.array([0.0, 0.0, 1e-4 * k]), estimate)[:, :2] - truth[:, :2]
            errors.append(math.sqrt(((apart - apart.mean(axis=0)) ** 2).sum(axis=1).mean()))
        least = planar_error(estimate, truth)[0]
        self.assertLessEqual(least, min(errors))
        self.assertAlmostEqual(least, min(errors), delta=1e-6)

    def test_the_error_of_nothing_is_none(self):
        self.assertTrue(math.isnan(planar_error(np.empty((0, 3)), np.empty((0, 3)))[0]))

    def test_poses_are_chained_by_motions(self):
        motion = np.array([1.0, 0.0, 0.5 * math.pi])
        square = chained(np.tile(motion, (4, 1)), np.array([2.0, 3.0, 0.0]))
        np.testing.assert_allclose(square[:, :2], [[2, 3], [3, 3], [3, 4], [2, 4], [2, 3]], atol=1e-15)


class PlanarTruthTest(unittest.TestCase):
    def test_the_axes_of_a_camera_become_those_of_a_robot(self):
        # Straight on for 7 m, 2 m to the left and 0.3 m down.
        tag, row, *numbers = planar_truth("1 0 0 -2  0 1 0 0.3  0 0 1 7\n").split()
        self.assertEqual((tag, row, *map(float, numbers)), ("VERTEX_SE2", "0", 7.0, 2.0, 0.0))

    def test_a_turn_to_the_left_is_positive(self):
        # The camera's z axis points to where -x was: a quarter turn to the left.
        lines = planar_truth("1 0 0 0 0 1 0 0 0 0 1 0\n0 0 -1 0 0 1 0 0 1 0 0 0\n").splitlines()
        tag, row, *numbers = lines[1].split()
        self.assertEqual((tag, row), ("VERTEX_SE2", "1"))
        self.assertEqual(float(numbers[2]), 0.5 * math.pi)

    def test_a_row_that_is_not_whole_is_left_out(self):
        self.assertEqual(planar_truth("1 0 0 0 0 1 0 0 0 0"), "")


class PublishedTest(unittest.TestCase):
    def test_figures_are_found_by_the_values_of_their_row(self):
        self.assertEqual(said("ila2017_graphs", "range", graph="parking-garage"), 95.0)
        self.assertEqual(said("ila2017_errors", "rpe_all.translation", graph="kitti_00", strategy="v1"), 12.363)

    def test_what_is_not_said_is_none(self):
        self.assertTrue(math.isnan(said("ila2017_errors", "ate.translation", graph="sphere2500", strategy="RFPFL")))
        self.assertTrue(math.isnan(said("ila2017_graphs", "range", graph="town")))
