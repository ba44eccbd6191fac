# SPDX-License-Identifier: BSD-3-Clause
"""Tables of docs/explore_results.md, of made-up reports, and the intervals in them."""
import math
import unittest

from bench.intervals import MeanInterval, mean_interval, median_interval, paired_difference, student_t_quantile, value_at
from bench.published import said
from bench.studies.explore import cover
from reports_of import report, section


def run(seed, map_entropy=500.0, loops=20.0, coverage=700.0, seconds=1.0, error=0.1, end="limit", **measures):
    """A run whose map has errors of so much of its coverage, as `cairn explore --json` writes it."""
    wrong = error * coverage
    return {"explorer": "x", "seed": seed, "end": end, "why": "250 m are driven",
            "measures": {"map_entropy": map_entropy, "loops": loops, "coverage": coverage, "distance": 250,
                         "trajectory_entropy": -6, "map_error": wrong, "collisions": 0, **measures},
            "measured_seconds": {"seconds": seconds, "decision_p95": 0.5},
            "samples": {"distance": [0, 250], "coverage": [0, coverage], "map_error": [0, wrong], "seen": [0, coverage],
                        "free_wrong": [0, wrong], "occupied_wrong": [0, 0]}}


def entry(part, method, *seeds):
    return {"part": part, "name": "fr079", "method": method, "explorer": method, "report": {
        "world": "lidar_building:fov=180", "policy": "p", "registration": "icp", "mapper": "log_odds",
        "runs": [run(k + 1, **figures) for k, figures in enumerate(seeds)]}}


class IntervalsTest(unittest.TestCase):
    def test_the_quantile_of_t_is_that_of_tables(self):
        for dof, quantile in [(1, 12.7062047361747), (2, 4.30265272974946), (4, 2.77644510519779), (9, 2.26215716279820),
                              (49, 2.00957523712924), (1000, 1.96233908082641)]:
            self.assertAlmostEqual(student_t_quantile(0.975, dof), quantile, delta=1e-12 * quantile)
        self.assertAlmostEqual(student_t_quantile(0.9, 3), 1.63774435369621, delta=1e-12)

    def test_a_mean_has_the_interval_of_t(self):
        interval = mean_interval([1.0, 2.0, math.nan, 6.0])
        self.assertEqual((interval.count, interval.mean), (3, 3.0))
        self.assertAlmostEqual(interval.half_width, 4.30265272974946 * math.sqrt(7.0 / 3.0), delta=1e-12)
        self.assertFalse(interval.excludes_zero())

    def test_of_one_number_there_is_no_interval_and_of_none_no_mean(self):
        self.assertEqual(mean_interval([2.5]).text(), "2.500")
        self.assertEqual(mean_interval([math.nan]).text(), "-")

    def test_the_interval_of_a_median_is_of_order_statistics(self):
        # Ranks from tables of the sign test, at 95 %.
        for count, rank in [(6, 1), (9, 2), (10, 2), (25, 8), (40, 14), (100, 40)]:
            values = [float(k) for k in range(count, 0, -1)]
            self.assertEqual(median_interval(values), (float(rank), float(count + 1 - rank)), count)
        self.assertEqual(median_interval([3.0, 1.0]), (1.0, 3.0))
        self.assertTrue(all(math.isnan(end) for end in median_interval([])))

    def test_two_digits_of_the_half_width_are_written(self):
        self.assertEqual(MeanInterval(2, 22.0, 25.4).text(), "22 ± 25")
        self.assertEqual(MeanInterval(2, 0.123456, 0.0123).text(sign=True), "+0.123 ± 0.012")
        self.assertEqual(MeanInterval(2, 30.0, 0.0).text(), "30.00 ± 0.00")

    def test_differences_are_paired(self):
        difference = paired_difference([10.0, 21.0], [11.0, 22.0])
        self.assertEqual((difference.mean, difference.half_width), (-1.0, 0.0))

    def test_a_curve_has_no_value_beyond_its_ends_and_does_not_go_back(self):
        x, y = [1.0, 3.0, 2.0, math.nan, 3.0, 5.0], [10.0, 30.0, 0.0, 7.0, 40.0, 60.0]
        self.assertEqual([value_at(x, y, place) for place in [1.0, 2.0, 3.0, 4.0, 5.0]], [10.0, 25.0, 40.0, 50.0, 60.0])
        for place in [0.9, 5.1, math.nan]:
            self.assertTrue(math.isnan(value_at(x, y, place)))
        self.assertTrue(math.isnan(value_at([], [], 1.0)))


class ThesisTest(unittest.TestCase):
    def test_the_figures_are_those_of_tables_5_4_to_5_6(self):
        def figure(part, method, measure):
            return said("vallve2018_exploration", measure, part=part, method=method)
        self.assertEqual(figure("cave", "ede_gradient", "loops"), 22.0)
        self.assertEqual(figure("freiburg", "ede_rrt_star", "seconds"), 11951.18)
        self.assertEqual(figure("action", "heuristic", "trajectory_entropy"), -10.11)
        self.assertTrue(math.isnan(figure("cave", "frontier", "coverage")))
        self.assertTrue(math.isnan(figure("action", "dopt", "loops")))
        # 988.6 − 0.615 · coverage, to 5.1 nats·m²: the table is consistent, and read right.
        for method in ["frontier", "heuristic", "ede_rrt_star", "drrt_star", "errt_star"]:
            self.assertAlmostEqual(figure("action", method, "map_entropy"), 988.6 - 0.615 * figure("action", method, "coverage"),
                                   delta=5.1)

    def test_means_are_put_beside_the_thesiss(self):
        table = section(report("explore_action", entry("action", "frontier", {"loops": 20.0}, {"loops": 24.0}),
                               entry("action", "ours: dopt", {"loops": 30.0}, {"loops": 30.0}),
                               {"part": "action", "name": "fr079", "method": "errt_star", "missing": True}), "explore-action")
        self.assertIn("| loop closures | 22 ± 25 (22.6) | 30.00 ± 0.00 | - (34.4) |", table)
        self.assertIn("| ends | 2 limit | 2 limit | not in this build |", table)
        self.assertIn("| the thesis's time per metre over ours | 1089 × | - | - |", table)
        self.assertIn("On `fr079`; world `lidar_building:fov=180`", table)

    def test_differences_are_paired_by_seed(self):
        # Seeds differ by much, the methods by 10 and 12, or by 0.5 in both.
        table = section(report("explore_scale", entry("scale", "frontier", {"map_entropy": 500.0}, {"map_entropy": 700.0, "loops": 40.0}),
                               entry("scale", "drrt_star", {"map_entropy": 490.0, "error": 0.05, "loops": 20.5},
                                     {"map_entropy": 688.0, "error": 0.05, "loops": 40.5})), "explore-scale")
        self.assertIn("| map entropy [nats·m²] | 600 ± 1271 (527.92) | 589 ± 1258 (526.58) |", table)
        self.assertIn("| loop closures | 30 ± 127 (22.6) | 30 ± 127 * (18.8) |", table)
        # 0.1 and 0.05 of 700 m²: the same in both seeds.
        self.assertIn("| map error at equal coverage [m²], less frontier's |  | -35.00 ± 0.00 * |", table)
        self.assertIn("| wrong cells, as much floor seen [m²], less frontier's |  | -35.00 ± 0.00 * |", table)

    def test_on_other_floors_differences_are_from_the_first_method_of_the_same_floor(self):
        def elsewhere(floor, method, loops, error):
            return {**entry("elsewhere", method, *({"loops": value, "error": error} for value in loops)), "name": floor}
        runs = report("explore_elsewhere", elsewhere("fr079", "frontier", [20.0, 24.0], 0.1),
                      elsewhere("fr079", "drrt_star", [21.0, 25.0], 0.05), elsewhere("depot", "frontier", [30.0, 30.0], 0.1),
                      elsewhere("depot", "drrt_star", [30.0, 30.0], 0.2))
        table = section(runs, "explore-elsewhere")
        self.assertIn("| fr079 | loop closures | 22 ± 25 | 23 ± 25 * |", table)
        self.assertIn("|  | map error at equal coverage [m²], less frontier's |  | -35.00 ± 0.00 * |", table)
        self.assertIn("| depot | loop closures | 30.00 ± 0.00 | 30.00 ± 0.00 |", table)
        self.assertIn("|  | map error at equal coverage [m²], less frontier's |  | +70.00 ± 0.00 * |", table)
        claims = section(runs, "explore-elsewhere-claims")
        self.assertIn("| claim | fr079 | depot |", claims)
        self.assertIn("has fewer wrong cells than frontier at equal parts seen | seen, clear of zero | not seen |", claims)

    def test_a_run_that_failed_has_no_measures_and_no_pair(self):
        table = section(report("explore_cave", entry("cave", "frontier", {"loops": 20.0}, {"loops": 24.0}),
                               entry("cave", "ede_gradient", {"loops": 21.0, "error": 0.2}, {"loops": 99.0, "end": "interrupted"})),
                        "explore-cave")
        self.assertIn("| loop closures | 22 ± 25 (15.4) | 21.00 (22) |", table)
        self.assertIn("| map error at equal coverage [m²], less frontier's |  | +70.00 |", table)

    def test_claims_are_seen_not_seen_or_not_measured(self):
        table = section(report(
            "explore_cave",
            entry("cave", "frontier", {"map_entropy": 50.0, "seconds": 3.0, "seen": 240.0},
                  {"map_entropy": 52.0, "seconds": 4.0, "seen": 260.0}),
            entry("cave", "ede_gradient", {"map_entropy": 51.0, "loops": 50.0, "seconds": 1.0, "seen": 299.0},
                  {"map_entropy": 51.0, "loops": 50.0, "seconds": 2.0, "seen": 299.0}),
            entry("cave", "ede_rrt_star", {"map_entropy": 51.0, "seconds": 1.1, "seen": 299.0},
                  {"map_entropy": 51.0, "seconds": 2.1, "seen": 299.0})),
            "explore-cave-claims")
        self.assertIn("similar map entropy (within 10 %) | seen", table)
        self.assertIn("full coverage (285 of the 300 m² seen) | not seen | seen: 285 − frontier = +35 ± 127", table)
        self.assertIn("many collisions (at least one per run) | not seen | collisions: 1 − frontier = +1.000 ± 0.000 |", table)
        self.assertIn("close a similar number of loops (within 50 %) | not seen | loops: ede_gradient − 1.50 · frontier = "
                      "+20.00 ± 0.00", table)
        self.assertIn("| both EDE take less time | seen, clear of zero |", table)
        alone = section(report("explore_cave", entry("cave", "frontier", {})), "explore-cave-claims")
        self.assertIn("| both EDE take less time | not measured |", alone)
        self.assertNotIn("| seen |", alone)


class FloorsTest(unittest.TestCase):
    def test_what_is_seen_without_noise(self):
        late = {"part": "exact", "name": "depot", "method": "frontier", "error": "took too long"}
        table = section(report("explore_exact", entry("exact", "frontier", {"reachable_seen": 0.995}), late), "explore-exact")
        self.assertIn("| fr079 | limit | 250 m are driven | 250 |", table)
        self.assertIn("| 99.5 % |", table)
        self.assertIn("| depot | took too long |", table)

    def test_what_was_changed_has_a_row_for_each_method(self):
        changed = {**entry("sensitivity", "drrt_star", {"loops": 20.0}, {"loops": 24.0}), "change": "range 4 m"}
        missing = {"part": "sensitivity", "method": "frontier", "change": "range 4 m", "missing": True}
        table = section(report("explore_sensitivity", changed, missing), "explore-sensitivity")
        self.assertIn("| range 4 m | drrt_star | 500.0 ± 0.0 | -6.000 ± 0.000 | 22 ± 25 |", table)
        self.assertIn("| range 4 m | frontier | not in this build | not in this build |", table)


class CoverTest(unittest.TestCase):
    def test_ends_errors_and_what_is_seen_are_counted_by_floor(self):
        def cover(floor, motion, *figures):
            runs = entry("default", "default", *({"reachable_seen": seen, "ate": ate, "end": end} for seen, ate, end in figures))
            return {**runs, "floor": floor, "view": "17°", "motion": motion}
        noted = cover("depot", "holonomic", (0.5, 0.7, "limit"), (0.7, 0.9, "limit"))
        noted["report"]["runs"][1]["notes"] = ["the positions are uncertain"]
        table = section(report("explore_default", cover("depot", "differential", (1.0, 0.1, "finished"), (0.9, 0.2, "finished")),
                               noted, {"part": "default", "floor": "fr079", "motion": "dubins", "error": "took too long"}),
                        "explore-default")
        self.assertIn("| depot | 4 | 95 % (90 %) | 60 % (50 %) | - | 2 | 1 | 2 | 0 | 0 | 0 | 0.450 | 0.900 | 2 | 1 |", table)
        self.assertIn("| fr079 | 0 | - | - | - | 0 | 0 | 0 | 0 | 2 |", table)
        self.assertIn("| all | 4 | 95 % (90 %) | 60 % (50 %) | - | 2 | 1 | 2 | 0 | 2 |", table)

    def test_a_third_of_the_settings_is_drawn_for_each_explorer(self):
        for explorer in ["frontier", "errt_star"]:
            third = cover.third_of(explorer)
            self.assertEqual(len(set(third)), 50)
            self.assertEqual(third, cover.third_of(explorer))
        self.assertNotEqual(cover.third_of("frontier"), cover.third_of("errt_star"))
        self.assertEqual(len(cover.SETTINGS), 10 * 5 * 3)

    def test_each_run_in_the_warehouse_has_a_row(self):
        table = section(report("explore_warehouse", entry("warehouse", "default", {
            "reachable_seen": 0.991, "ate": 0.12, "expected_ate": 0.1, "wrong": 5.0})), "explore-warehouse")
        self.assertIn("| 1 | limit | 99.1 % | 250 | 0.120 | 0.100 | 5.00 | 20 | 0 |", table)
