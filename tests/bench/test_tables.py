# SPDX-License-Identifier: BSD-3-Clause
"""Tables and pictures of docs/performance.md, of made-up reports."""
import json
import unittest

from reports_of import report, section, studies


def configuration(optimizer, linear_solver, seconds_per_iteration, chi2):
    """Two rounds of ten iterations; Ceres ended after two, of which it took one."""
    run = {"iterations": 10, "seconds": {"total": 10 * seconds_per_iteration}}
    history = [{"accepted": True}, {"accepted": False}] if optimizer.startswith("ceres") else [{"accepted": True}] * 10
    return {"optimizer": optimizer, "linear_solver": linear_solver, "chi2": {"final": chi2}, "peak_memory_bytes": 25000000,
            "seconds": {"median": 1, "min": 1, "max": 1, "per_iteration": seconds_per_iteration}, "runs": [run, run],
            "history": history}


def graphs_report():
    """Two published graphs and a generated one; the second CHOLMOD is the faster."""
    def entry(name, generated, ours, theirs):
        return {"name": name, "generated": generated, "threads": 1, "measured": {
            "graph": {"variables": 100, "factors": 200},
            "configurations": [
                configuration("gauss_newton", "block_cholesky", ours, 146.5),
                configuration("gauss_newton", "cholmod:mode=simplicial,ordering=amd", 2 * theirs, 146.5),
                configuration("gauss_newton", "cholmod:mode=supernodal,ordering=metis", theirs, 146.5),
                configuration("ceres:sparse_library=cx_sparse,initial_radius=1e16", "X", 4 * ours, 293.0)]}}
    return report("graphs", entry("first", False, 0.002, 0.004), entry("second", False, 0.002, 0.016),
                  entry("made", True, 0.002, 0.010))


class GraphsTest(unittest.TestCase):
    def test_the_best_setting_of_each_peer_is_taken(self):
        table = section(graphs_report(), "graphs-1")
        self.assertIn("| first | 100 | 200 | 2.00 | 4.00 (supernodal, metis) | 2.00 × | 8.00 (cx_sparse; 1 of 2 steps taken) "
                      "| 4.00 × | 0 | 1e+00 | 25 / 25 / 25 |\n", table)
        self.assertNotIn("simplicial", table)

    def test_ratios_of_published_and_generated_graphs_are_averaged_apart(self):
        table = section(graphs_report(), "graphs-1")
        self.assertIn("**published, geometric mean** |  |  |  |  | **4.00 ×**", table)
        self.assertIn("**generated, geometric mean** |  |  |  |  | **5.00 ×**", table)

    def test_thread_counts_have_tables_of_their_own(self):
        self.assertNotIn("first", section(graphs_report(), "graphs-2"))

    def test_machine_build_and_commit_are_named(self):
        self.assertIn("*Some CPU, 2 cores, avx2; gcc, `-O3`; commit abc1234.*", section(graphs_report(), "graphs-1"))

    def test_only_the_best_of_each_family_is_drawn(self):
        picture = json.loads(studies()["graphs"].files(graphs_report()["entries"])["graphs_picture.json"])
        self.assertEqual(len(picture["graphs"]), 3)
        bars = picture["graphs"][0]["configurations"]
        self.assertEqual([(bar["optimizer"], bar["seconds"]["median"]) for bar in bars],
                         [("block_cholesky", 0.02), ("cholmod", 0.04), ("ceres", 0.08)])

    def test_one_thread_is_compared_with_two(self):
        threads = report("threads", {"name": "torus", "one": {"iteration": 0.04, "factorize": 0.03},
                                     "two": {"iteration": 0.025, "factorize": 0.015}})
        self.assertIn("| torus | 30.0 | 15.0 | 2.00 × | 40.0 | 25.0 | 1.60 × |\n", section(threads, "threads"))

    def test_of_each_family_the_nearly_best_settings_are_measured(self):
        from bench.program import Settings
        from bench.studies.graphs import nearly_best
        scouted = {"configurations": [
            configuration("gauss_newton", "block_cholesky", 9.0, 1.0), configuration("gauss_newton", "cholmod:a", 1.3, 1.0),
            configuration("gauss_newton", "cholmod:b", 1.0, 1.0), configuration("gauss_newton", "cholmod:c", 1.2, 1.0),
            configuration("ceres:d", "X", 2.0, 1.0), {"optimizer": "ceres:e", "error": "no"}]}
        chosen = nearly_best(scouted, Settings(["block_cholesky", "cholmod:a"]))
        self.assertEqual((chosen.linear_solvers, chosen.complete), (["block_cholesky", "cholmod:b", "cholmod:c"], ["ceres:d"]))


class RatesTest(unittest.TestCase):
    def test_rates_are_given_against_the_nearer_roof(self):
        # 2 GFLOP in 0.1 s; 2e9 / (16 * 1.25e8) = 1 flop per byte at 25 GB/s lies below dgemm's 50.
        rates = report("rates", {"name": "big", "factorize": 0.1, "dgemm": 5e10, "bandwidth": 2.5e10, "solver": {
            "ordering": "amd", "factor_flops": 2e9, "factor_nonzeros": 125000000}})
        self.assertIn("| big | amd | 125 M | 2 G | 100 | 20.0 | 40 % | 1.00 | 25.0 | 80 % |\n", section(rates, "rates"))

    def test_it_is_said_where_there_is_no_dgemm_to_compare_with(self):
        rates = report("rates", {"name": "big", "factorize": 0.1, "dgemm": None, "bandwidth": 2.5e10,
                                 "solver": {"factor_flops": 2e9, "factor_nonzeros": 125000000}})
        self.assertIn("No OpenBLAS", section(rates, "rates"))


class PrecisionTest(unittest.TestCase):
    def entry(self, name, mixed, note):
        """Of two rounds; a second is spent before the first iteration."""
        def contestant(name, seconds, note=""):
            run = {"processor": 1.0 + seconds, "chi2": {"final": 100.0},
                   "solver": {"factor_flops": 5e8, "factor_nonzeros": 1e6, "note": note}}
            return {"name": name, "runs": [run, run]}
        return {"name": name, "contestants": [contestant("start", 0.0), contestant("double", 0.2),
                                              contestant("mixed", mixed, f"9 supernodes; mixed precision: {note}")]}

    def test_what_is_worthwhile_is_in_bold(self):
        table = section(report("precision", self.entry("solid", 0.1, "10 solutions refined in 45 steps"),
                               self.entry("flat", 0.2, "0 solutions refined in 0 steps, then double precision, since")),
                        "precision")
        self.assertIn("| solid | 500 | 20.0 | 10.0 | **2.00 ×** | 4.50 | 0 |\n", table)
        self.assertIn("| flat | 500 | 20.0 | 20.0 | 1.00 × | falls back | 0 |\n", table)
        self.assertIn("**1.41 ×**", table)


def scaling_report():
    """Three sizes of quadratic growth, the smallest outside the fit, and one left out."""
    def entry(poses, seconds):
        return {"family": "city", "study": "ten iterations", "poses": poses, "graph": {"variables": poses, "factors": 7},
                "iterations": 5, "solver": {}, "seconds": seconds, "peak_memory_bytes": 1000 * poses}
    return report("scaling", entry(1000, 77), entry(10000, 1), entry(100000, 100),
                  {"family": "city", "poses": 1000000, "left_out": "too long"})


class ScalingTest(unittest.TestCase):
    def test_the_growth_is_fitted_from_ten_thousand_poses_on(self):
        self.assertIn("| city | 10000 … 100000 | 2 | n^2.00 | n^1.00 |\n", section(scaling_report(), "growth"))

    def test_sizes_that_were_left_out_are_listed(self):
        self.assertIn("left out: too long", section(scaling_report(), "scaling"))

    def test_a_forecast_goes_on_with_the_last_growth(self):
        from bench.studies.scaling import Forecast
        forecast = Forecast()
        self.assertEqual(forecast.at(1000), 0.0)
        forecast.add(1000, 2.0)
        self.assertAlmostEqual(forecast.at(2000), 8.0)
        forecast.add(2000, 4.0)
        self.assertAlmostEqual(forecast.at(6000), 12.0)


class SolversTest(unittest.TestCase):
    @staticmethod
    def entry(setting, chi2):
        return {"name": "park", "setting": setting, "result": "converged", "finished": True,
                "graph": {"variables": 9, "factors": 8}, "iterations": 3, "seconds": 0.01,
                "chi2": {"initial": 1e4, "final": chi2}}

    def test_another_chi2_is_pointed_out(self):
        stuck = {"name": "park", "setting": "stuck", "result": "not finished after 60 s"}
        entries = [self.entry("ours", 100.0), self.entry("same", 100.0), self.entry("worse", 200.0), stuck]
        text = section(report("solvers", *entries), "solvers")
        self.assertIn("**park** (9 variables, 8 factors)\n", text)
        self.assertIn("| `same` | 100 | 0 | 3 |  | 10.0 | 1.00 × | - | converged |\n", text)
        self.assertIn("| 1e+00 | 3 |  | 10.0 | 1.00 × | - | converged, **another chi2** |", text)
        self.assertIn("| `stuck` | - | - | - |  | - | - | - | not finished after 60 s |", text)

    def test_rounding_is_not_another_chi2(self):
        text = section(report("solvers", self.entry("x", 4e-25), self.entry("x", 2e-25)), "solvers")
        self.assertIn("| 2e-25 | 2e-17 |", text)
        self.assertNotIn("another chi2", text)

    def test_a_graph_that_was_not_read_has_no_table(self):
        text = section(report("solvers", {"name": "park", "setting": "ours", "result": "no plugin"}), "solvers")
        self.assertTrue(text.startswith("**park**: no plugin\n"))


class MarginalsTest(unittest.TestCase):
    def test_covariances_are_compared_with_solves_where_those_were_measured(self):
        small = {"name": "small", "graph": {"variables": 100}, "solver": {"factor_nonzeros": 5000}, "factorize": 0.001,
                 "both": 0.002, "diagonal": 0.0015, "column": 0.0005, "two_threads": 0.0016, "solves": 0.05}
        large = {"name": "large", "graph": {"variables": 90000}, "solver": {}, "factorize": 0.1, "both": 0.2,
                 "diagonal": 0.15, "column": 0.05, "two_threads": 0.16, "solves": None}
        table = section(report("marginals", small, large), "marginals")
        self.assertIn("| small | 100 | 5 k | 1.00 | 1.50 | 0.500 | 2.00 | 1.60 | 50.0 | 25.0 × |", table)
        self.assertIn("| large | 90000 | - | 100 | 150 | 50.0 | 200 | 160 | - | - |", table)


def replay(name, seconds, chi2, **more):
    """A run of 200 steps."""
    run = {"seconds": {"total": seconds, "marginals": 0.5}, "peak_memory_bytes": 3e7, "chi2": chi2,
           "steps": {"count": 200, "median": 0.001, "p95": 0.002, "p99": 0.003, "max": 0.004}, **more}
    return {"name": name, "in_time": True, "limit": 60, "runs": [run]}


def online_report():
    """chi2 is rounding at the first sample, 2 % above batch at the second; the last is finished."""
    checks = [{"step": 1, "chi2": 3e-20, "batch": 1e-20, "polished": 1e-20},
              {"step": 100, "chi2": 51.0, "batch": 50.0, "polished": 50.5},
              {"step": 200, "chi2": 100.0, "batch": 400.0, "polished": 100.0}]
    late = {"name": "batch", "in_time": False, "limit": 60, "runs": []}
    by = {"downdate": 150, "recomputation": 50}
    return report(
        "online",
        {"part": "times", "name": "town", "checks": checks, "contestants": [
            replay("incremental_cholesky", 2.0, 100.5), replay("periodic_batch", 8.0, 103.0), late]},
        {"part": "marginals", "name": "town", "contestants": [replay("incremental_cholesky", 2.5, 100.5, marginals_by=by)]})


class OnlineTest(unittest.TestCase):
    def test_replays_are_compared_and_one_was_not_finished(self):
        self.assertIn("| town | 200 | 2.00 | 1.00 | 2.00 | 3.00 | 4.00 | 8.00 | 4.00 × | 4.00 | > 60 | - | 30 / 30 |\n",
                      section(online_report(), "online-times"))

    def test_the_lower_of_two_batches_counts_and_samples_of_rounding_do_not(self):
        self.assertIn("| town | 100.5 | 400 | 100 | 0.500 % | 2.000 % | 0.000 % | 3.000 % |\n",
                      section(online_report(), "online-chi2"))

    def test_the_share_of_covariances_and_how_they_were_brought_up_to_date(self):
        self.assertIn("| town | 200 | 2.50 | 2.00 | 20 % | 1.00 | 2.00 | 3.00 | 4.00 | 150 | 50 | 0 | 30 |\n",
                      section(online_report(), "online-marginals"))

    def test_a_limit_of_time_is_compared_with_none(self):
        checks = [{"step": 200, "chi2": 100.5, "batch": 100.0, "polished": 100.0}]
        table = section(report("online", {"part": "budget", "name": "town", "budget": 0.005, "contestants": [
            replay("none", 2.0, 100.5, owed=0, checks=checks), replay("budget", 1.0, 101.0, owed=17, checks=checks)]}),
            "online-budget")
        self.assertIn("| town | none | 2.00 | 1.00 | 2.00 | 3.00 | 4.00 | 100.5 | 0.500 % | 0 |\n", table)
        self.assertIn("| town | 5.00 | 1.00 | 1.00 | 2.00 | 3.00 | 4.00 | 101 | 1.000 % | 17 |\n", table)

    def test_a_point_is_drawn_for_so_many_steps(self):
        def steps(setting, longest):
            return {"part": "steps", "name": "town", "setting": setting, "every": 3, "longest": longest}
        files = studies()["online"].files([steps("ours", [0.1, 0.2]), steps("theirs", [0.3, 0.4])])
        graphs = json.loads(files["online_picture.json"])["graphs"]
        self.assertEqual(len(graphs), 1)
        curves = graphs[0]["configurations"]
        self.assertEqual([curve["optimizer"] for curve in curves], ["ours, longest of 3", "theirs, longest of 3"])
        self.assertEqual([point["seconds"] for point in curves[0]["history"]], [None, None, 0.1, None, None, 0.2])
