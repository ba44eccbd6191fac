# SPDX-License-Identifier: BSD-3-Clause
"""What is drawn of the runs in a folder: the command lines of `cairn plot`, and what ./dev bench does around it."""
import contextlib
import io
import os
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from bench import full_run, pictures

PROGRAM = f"""#!{sys.executable}
import os, sys
with open(os.environ["RECORD"], "a") as record:
    print(*sys.argv[1:], sep="|", file=record)
sys.exit(3 if "fails.svg" in sys.argv[-2] else 0)
"""


class PicturesTest(unittest.TestCase):
    """A folder of runs, and a program that records what it is asked to draw."""

    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(place.name)
        Path("runs/work").mkdir(parents=True)
        Path("cairn").write_text(PROGRAM, encoding="utf-8")
        Path("cairn").chmod(0o755)
        environment = mock.patch.dict(os.environ, RECORD=f"{place.name}/record")
        environment.start()
        self.addCleanup(environment.stop)

    def drawn(self, *files):
        """The command lines for a folder with these files, without those of earlier calls."""
        for file in files:
            (Path("runs") / file).touch()
        Path("record").write_text("", encoding="utf-8")
        self.assertEqual(pictures.main(["./cairn", "runs", "images"]), 0)
        return [line.split("|") for line in Path("record").read_text(encoding="utf-8").splitlines()]

    def images(self, *files):
        return [line[-2] for line in self.drawn(*files)]

    def test_of_nothing_nothing_is_drawn(self):
        self.assertEqual(self.drawn(), [])

    def test_a_report_is_drawn_as_it_is(self):
        self.assertEqual(self.drawn("graphs_picture.json"), [
            ["plot", "runs/graphs_picture.json", "--what", "bars", "--size", "900x2000", "-o", "images/performance_graphs.svg",
             "--quiet"]])

    def test_curves_have_the_names_of_the_explorers_that_there_are(self):
        lines = self.drawn("work/explore_cave_errt_star.csv", "work/explore_cave_frontier.csv", "work/explore_cave_unknown.csv")
        begin = ["plot", "runs/work/explore_cave_frontier.csv", "runs/work/explore_cave_errt_star.csv",
                 "--name", "frontier", "--name", "errt_star"]
        self.assertEqual(lines, [
            [*begin, "--x", "distance", "--y", "map_entropy *", "--y", "trajectory_entropy *", "--size", "900x420",
             "-o", "images/explore_cave_entropies.svg", "--quiet"],
            [*begin, "--x", "known", "--y", "map_error *", "--size", "900x420",
             "-o", "images/explore_cave_errors.svg", "--quiet"]])

    def test_both_trees_are_of_one_decision_that_both_have(self):
        files = [Path("runs/work/figure_action_drrt_star.jsonl"), Path("runs/work/figure_action_errt_star.jsonl")]
        for counts, decision in [((40, 50), "34"), ((40, 7), "7"), ((0, 40), "1")]:
            for file, count in zip(files, counts):
                file.write_text('{"kind":"start"}\n' + '{"kind":"drive"}\n{"kind":"scan"}\n' * count, encoding="utf-8")
            line = self.drawn()[-1]
            self.assertEqual(line[line.index("--decision") + 1], decision)
        self.assertEqual(line[1:3], [str(file) for file in files])

    def test_small_maps_are_vectors_with_ellipses(self):
        large = self.images("work/figure_city_apal.g2o")
        self.assertEqual(large, ["images/compact_map_city.png"])
        both = self.images("work/figure_ring_apal.g2o", "work/figure_ring_norms.csv")
        small = [f"images/compact_{what}_ring.svg" for what in ("norms", "ellipses", "map")]
        self.assertEqual(both, [*large, *small])

    def test_recovered_poses_are_drawn_with_the_truth_where_it_is_known(self):
        without = self.drawn("work/recovery_v0_detail.g2o")
        self.assertEqual(without[0], ["plot", *(f"runs/work/recovery_v{k}.g2o" for k in range(3)), "--name", "v0", "--name", "v1",
                                      "--name", "v2", "--size", "900x600", "-o", "images/compact_recovery.png", "--quiet"])
        known = self.drawn("work/recovery_truth.g2o")
        self.assertEqual([line[4:6] for line in known],
                         [["--truth", "runs/work/recovery_truth.g2o"], ["--truth", "runs/work/recovery_truth_detail.g2o"]])
        self.assertEqual([line[:4] + line[6:] for line in known], without)

    def test_all_are_drawn_one_study_after_the_other(self):
        self.assertEqual(self.images(
            "scaling_picture.json", "online_picture.json", "compact_growth_picture.json", "compact_gain.csv",
            "work/sparsify_iterations.csv", "work/sparsify_original.g2o", "sparsify_example.csv",
            "work/figure_freiburg_frontier.jsonl", "work/recovery_v0_detail.g2o"), [f"images/{name}" for name in (
                "performance_scaling.svg", "online_steps.svg", "compact_growth.svg", "compact_gain.svg", "compact_recovery.png",
                "compact_recovery_detail.svg", "sparsify_iterations.svg", "sparsify_times.svg", "sparsify_result.png",
                "sparsify_example.svg", "explore_freiburg_maps.png")])

    def test_the_first_picture_that_fails_is_the_last(self):
        for name in ("a", "fails", "z"):
            (Path("runs/work") / f"figure_{name}_apal.g2o").touch()
        with mock.patch.object(pictures, "draw_compact_map", lambda plotter, _, name: plotter.plot(f"{name}.svg", [])):
            self.assertEqual(pictures.main(["./cairn", "runs", "images"]), 3)
        self.assertEqual(Path("record").read_text(encoding="utf-8").count("plot"), 2)


class FullRunTest(unittest.TestCase):
    """In a checkout with pages, where studies are not measured."""

    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(place.name)

    def run_on(self, *words, code=0):
        """The exit code, and the arguments of each part."""
        for page in full_run.PAGES:
            page.parent.mkdir(exist_ok=True)
            page.write_text("page\n", encoding="utf-8")
        parts = []

        def part(arguments):
            parts.append(arguments)
            return code

        with mock.patch.object(full_run.command_line, "main", part), mock.patch.object(full_run.pictures, "main", part), \
                contextlib.redirect_stdout(io.StringIO()), mock.patch.object(full_run, "measured_commit", lambda: "abc"):
            return full_run.main(["cairn", *words]), parts

    def test_it_measures_writes_tables_and_draws(self):
        self.assertEqual(self.run_on("--data", "there", "graphs"), (0, [
            ["--folder", "build/bench", "--cairn", "cairn", "--commit", "abc", "--data", "there", "graphs"],
            ["--folder", "build/bench", "--tables", *map(str, full_run.PAGES), "--latex", "build/bench/latex"],
            ["cairn", "build/bench", "docs/images"]]))

    def test_a_quick_run_leaves_the_pages_alone(self):
        _, (measured, written, drawn) = self.run_on("--quick")
        folder = "build/bench/quick"
        self.assertEqual((measured[1], drawn[1:]), (folder, [folder, f"{folder}/images"]))
        self.assertEqual(written[3:-2], [f"{folder}/{page.name}" for page in full_run.PAGES])
        self.assertTrue(all(Path(page).read_text(encoding="utf-8") == "page\n" for page in written[3:-2]))

    def test_it_ends_where_anything_fails(self):
        code, parts = self.run_on("graphs", code=1)
        self.assertEqual((code, len(parts)), (1, 1))
