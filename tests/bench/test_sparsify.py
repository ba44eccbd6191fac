# SPDX-License-Identifier: BSD-3-Clause
"""Tables of docs/sparsify_results.md, of made-up reports."""
import json
import math
import tempfile
import unittest
from pathlib import Path

from bench.program import Cairn
from bench.published import said
from bench.studies.sparsify.example import measure_example, middle_problem
from bench.study import Bench
from reports_of import report, section, studies


def run(kld, seconds):
    """A run that took out half of 100 poses."""
    return {"poses": {"in": 100, "kept": 50}, "factors": {"in": 300, "out": 200},
            "problems": {"count": 49, "mean_blanket": 2.5, "largest_blanket": 9}, "kld": kld, "kld_parts": {"mean": 0.5},
            "rmse": 0.02, "rmse_aligned": 0.01, "rmse_full": 0.4, "seconds": {"total": seconds, "topology": 0.25, "select": 0.125},
            "steps": {"median": 0.001, "p99": 0.002, "max": 0.003}}


def contestant(name, *runs):
    return {"name": name, "in_time": True, "limit": 300, "runs": list(runs)}


def entry(graph, *contestants, **more):
    return {"name": graph, "contestants": list(contestants), **more}


def sets_entry(graph, keep_every, kld):
    return entry(graph, contestant("clt", run(10.0 * kld, 0.1)), contestant("ncfd", run(kld, 1.0), run(kld, 3.0)),
                 scheme="single", keep_every=keep_every)


class ThesisTest(unittest.TestCase):
    def test_figures_are_found_by_graph_scheme_and_part_kept(self):
        def loss(graph, scheme, by, keep_every):
            return said("vallve2018_losses", "kld", graph=graph, scheme=scheme, by=by, keep_every=keep_every)
        self.assertEqual(said("vallve2018_counts", "problems", graph="M3500", scheme="multi", topology="mi", keep_every=4), 909.0)
        self.assertEqual(loss("MITb", "multi", "ncfd", 10), 0.28)
        self.assertEqual(loss("Intel", "single", "clt", 5), said("vallve2018_topologies", "kld", graph="Intel", which="clt"))
        self.assertTrue(math.isnan(loss("M3500", "runs", "ncfd", 5)))
        self.assertTrue(math.isnan(loss("M3500", "single", "ncfd", 7)))

    def test_counts_are_put_beside_the_thesiss(self):
        table = section(report("sparsify_sets", sets_entry("M3500", 3, 4.0), sets_entry("M3500", 5, 4.0),
                               sets_entry("city", 5, 4.0)), "sparsify-counts")
        self.assertIn("| M3500 | single | clt | 49 / 2332 | - / 2624 | 49 / 2799 |", table)
        self.assertIn("| city | single | mi | - | - | 49 | - |", table)

    def test_losses_are_put_beside_the_thesiss(self):
        sets = report("sparsify_sets", sets_entry("M3500", 5, 5.38), sets_entry("city", 5, 4.0))
        table = section(sets, "sparsify-recovery")
        self.assertIn("|  |  |  | ncfd | 5.38 | 2.69 | 2.00 × | 0.0200 | 0.035 | 2.00 | 3.9 |\n", table)
        self.assertIn("|  |  |  | ncfd | 4.00 |  |  | 0.0200 |  | 2.00 |  |\n", table)
        ratios = section(sets, "sparsify-ratios")
        self.assertIn("| ncfd | 1 | 2.00 × | 2.00 × | 2.00 × |", ratios)
        self.assertIn("| 1.95 × |\n", ratios)

    def test_losses_at_common_states_are_compared(self):
        more = {"scheme": "multi", "keep_every": 5}
        table = section(report("sparsify_sets",
                               entry("M3500", contestant("common ncfd", run(4.0, 0.5)), contestant("default", run(3.0, 0.5)), **more),
                               entry("city", contestant("clt", run(4.0, 0.5)), **more)), "sparsify-common")
        self.assertIn("| M3500 | multi | 5 | - | - | 4.00 | 0.0100 | 3.00 | 0.0100 | 0.400 |\n", table)
        self.assertNotIn("city", table)

    def test_topologies_are_put_beside_the_thesiss(self):
        topologies = report("sparsify_topology", entry("Intel", contestant("tree:2 odd", run(1.99, 0.5)), part="topologies"),
                            entry("Intel", contestant("mi:epsilon=0.1", run(5.0, 0.5)), part="regularization"))
        table = section(topologies, "sparsify-topology")
        self.assertIn("| Intel | `tree:2 odd` | 1.99 | 3.98 | 0.500 × | 0.0200 | 0.03 | 0.500 | 5.31 | 0.250 | 0.1 | 200 | 563 |\n",
                      table)
        self.assertNotIn("epsilon", table)
        self.assertIn("| Intel | `mi` | - | - | 5.00 | - | - | 5.15 |\n", section(topologies, "sparsify-regularization"))


class WholeTest(unittest.TestCase):
    def test_graphs_in_space_and_large_ones_have_tables_of_their_own(self):
        whole = report("sparsify_whole",
                       entry("sphere", contestant("default", run(3.0, 0.5)), contestant("clt", run(9.0, 0.1)), part="space",
                             keep_every=2), entry("city", contestant("late", run(3.0, 0.5)), part="large", keep_every=5))
        self.assertIn("| sphere | 2 | default | 50 of 100 | 200 of 300 | 2.50 | 9 | 3.00 | 0.500 | 0.0100 | 0.500 |\n"
                      "|  |  | `clt` |", section(whole, "sparsify-space"))
        self.assertNotIn("city", section(whole, "sparsify-space"))
        self.assertIn("| city | every 100 poses | 50 of 100 | 200 of 300 | 2.50 | 9 | 3.00 | 0.500 | 0.0600 | 0.0100 | 0.500 "
                      "| 10.0 |\n", section(whole, "sparsify-large"))

    def test_steps_are_compared_with_those_of_all_nodes(self):
        steps = {"median": 0.004, "p99": 0.005, "max": 0.006}
        table = section(report("sparsify_online", entry("manhattan", contestant("late", run(3.0, 0.5)), steps_of_all=steps)),
                        "sparsify-online")
        self.assertIn("| manhattan | all nodes stay | 100 | 300 |  |  |  |  | 4.00 | 5.00 | 6.00 |  |\n", table)
        self.assertIn("| 0.400 | 1.00 | 2.00 | 3.00 | 0.500 |\n", table)

    def test_what_selecting_takes(self):
        self.assertIn("| M3500 | `oldest:part=0.5` | 50 of 100 | 200 of 300 | 2.50 | 9 | 3.00 | 0.500 | 0.0100 | 0.125 | 0.500 |\n",
                      section(report("sparsify_selection", entry("M3500", contestant("oldest:part=0.5", run(3.0, 0.5)))),
                              "sparsify-selection"))

    def test_every_choice_of_loop_closures_has_a_column(self):
        def of(kld, connectivity, **bound):
            return {"loops": {"in": 40, "kept": 10}, "kld": kld, "rmse_aligned": 0.25, "seconds": {"select": 1.5},
                    "connectivity": {"rotation": {"full": 8, "sparse": connectivity, **bound}}}
        made = report("sparsify_edges", entry("M3500", contestant("mac", of(3.0, 2.0, bound=4)),
                                              contestant("random", of(5.0, 1.0), of(7.0, 1.0), of(4.0, 1.0))))
        self.assertIn("| M3500 | 10 of 40 | - | 3.00 | - | - | - | - | 5.00 |\n", section(made, "sparsify-edges-kld"))
        self.assertIn("| M3500 | 10 of 40 | 50 % | 25 % | - | - | - | - | 12 % |\n", section(made, "sparsify-edges-connectivity"))
        self.assertIn("| 0.250 | - |", section(made, "sparsify-edges-rmse"))
        self.assertIn("| 1.50 | - |", section(made, "sparsify-edges-time"))


def row(topology, recovery, nodes, kld, refused=0, not_converged=0):
    return {"topology": topology, "recovery": recovery, "nodes": nodes, "problems": 8, "kld": kld, "kld_deviation": 0.25,
            "largest_excess": 1e-5, "factors": 5, "iterations": 12, "refused": refused, "not_converged": not_converged,
            "not_positive": 0, "seconds": {"topology": 1e-6, "recovery_median": 2e-6}}


def problems(part, *rows):
    return report("sparsify_problems", {"part": part, "recording": "whole", "rows": list(rows)})


class ProblemsTest(unittest.TestCase):
    def test_recoveries_are_compared_by_size(self):
        table = section(problems("recovery", row("mi", "ip", None, 0.5), row("mi", "ip", 4, 1e-17), row("mi", "fd", 4, 0.25)),
                        "sparsify-problems")
        self.assertIn("| whole graph | all | 8 | 5.00 | 0.500 | - | - | 1e-05 | - |", table)
        self.assertIn("|  | 4 | 8 | 5.00 | 0 | 1e-05 | - | 1e-05 | - |", table)
        self.assertIn("|  | 4 | 12.0 | - | 12.0 | - | 2.00 | - | 2.00 | - |\n", table)
        self.assertIn("8 recoveries: all converged", table)

    def test_which_failed(self):
        self.assertIn("10 recoveries; 1 did not converge (`pqn`, to 1e-3); 2 were refused (`pqn`, to 1e-3).\n",
                      section(problems("recovery", row("mi", "pqn:memory=3", None, 0.5, 2, 1)), "sparsify-problems"))

    def test_initial_guesses_are_compared(self):
        table = section(problems("initial", row("mi", "fd:initial=odb,iterations=0", 4, 2.0), row("mi", "ncfd", 4, 1.0)),
                        "sparsify-initial")
        self.assertIn("| whole graph | 4 | 8 | - ± - | 2.00 ± 0.250 | - ± - | - ± - | 1.00 ± 0.250 |\n", table)

    def test_the_example_is_the_problem_in_the_middle(self):
        made = [{"sizes": [3] * nodes, "kld": kld} for nodes, kld in [(6, 0.5), (5, 0.1), (6, 0.1), (6, 0.9)]]
        self.assertEqual(middle_problem(made, 6), made[0])
        self.assertEqual(middle_problem(made, 4), None)

    def test_the_example_has_a_curve_for_each_topology(self):
        def of(factors, topology, kld):
            return {"factors": factors, "topology": topology, "kld": kld}
        files = studies()["sparsify_problems"].files([{"part": "example", "rows": [
            of(5, "mi", 0.5), of(5, "best:most=10000,beyond=refuse", 0.25), of(6, "mi", 0.125), of(6, "odd", -1e-16)]}])
        self.assertEqual(files, {"sparsify_example.csv": 'factors,"KLD, mi","KLD, dmi","KLD, ekld","KLD, odd","KLD, best"\n'
                                                         "5,0.5,,,,0.25\n6,0.125,,,,\n"})

    def test_all_topologies_solve_the_example_with_every_number_of_factors(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "problems.json"
            file.write_text(json.dumps({"problems": [{"sizes": [3] * 5, "kld": 1.0}]}), encoding="utf-8")
            asked = []

            def solve(problem, words):
                self.assertEqual(len(json.loads(problem.read_text(encoding="utf-8"))["problems"]), 1)
                asked.append(words[words.index("--population") + 1])
                return [row("mi", "ncfd", nodes, 0.5) for nodes in [None, 5]]
            example = measure_example(Bench(Cairn("cairn", Path(folder)), quick=True), file, solve)
        # Of ten pairs of five nodes, four to nine.
        self.assertEqual([round(10 * float(population.partition(":")[2])) for population in asked], [4, 5, 6, 7, 8, 9])
        self.assertEqual([one["factors"] for one in example["rows"]], [4, 5, 6, 7, 8, 9])

    def test_topologies_that_did_all_problems_are_compared(self):
        table = section(problems("topology", row("mi", "ncfd", 4, 2.0), row("best:most=9", "ncfd", 4, 1.0),
                                 row("mi", "ncfd", 5, 4.0), row("best:most=9", "ncfd", 5, 3.0, 1)), "sparsify-topologies")
        self.assertIn("| 8 | 5.00 | 2.00 | - | - | - | - | 1.00 | 1.00 |", table)
        self.assertIn("| 8 | 5.00 | 4.00 | - | - | - | - | - | 1.00 |", table)
