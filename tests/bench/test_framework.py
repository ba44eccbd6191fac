# SPDX-License-Identifier: BSD-3-Clause
"""Child processes with limits, interleaved rounds, statistics, numbers in words, pages, the command line."""
import contextlib
import io
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from bench import averages, command_line, pages, words
from bench.data_sets import DataSet, located, sets_of
from bench.processes import Outcome, allowed_memory, run_program
from bench.program import Cairn, Failed, Run, with_start
from bench.reports import member, number
from bench.rounds import Contestant, run_rounds
from bench.study import attempt


class ProcessesTest(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.work = Path(place.name)

    def python(self, program, limit=0.0):
        return run_program([sys.executable, "-c", program], self.work, limit)

    def test_output_complaint_and_exit_code_are_kept(self):
        outcome = self.python("import sys; print('out'); print('first\\nlast', file=sys.stderr); sys.exit(3)")
        self.assertEqual((outcome.output, outcome.complaint, outcome.exit_code), ("out\n", "last", 3))
        self.assertTrue(outcome.in_time)

    def test_two_measurements_in_one_folder_do_not_mix(self):
        program = ("import sys; from pathlib import Path; from bench.processes import run_program; "
                   "print(run_program([sys.executable, '-c', 'import time; print(1, flush=True); time.sleep(2)'], "
                   "Path(sys.argv[1])).output, end='')")
        with subprocess.Popen([sys.executable, "-c", program, str(self.work)], stdout=subprocess.PIPE, text=True,
                              env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}) as other:
            outputs = []
            while other.poll() is None:
                outputs.append(self.python("print('another')").output)
            self.assertEqual(other.stdout.read(), "1\n")
        self.assertEqual(set(outputs), {"another\n"})
        self.assertEqual(list(self.work.iterdir()), [])

    def test_the_peak_of_memory_is_that_of_the_child(self):
        self.assertGreater(self.python("bytearray(b'x') * 300_000_000").peak_memory, 3e8)
        self.assertLess(self.python("pass").peak_memory, 1e8)

    def test_what_takes_too_long_is_interrupted_and_may_still_report(self):
        program = "import time\ntry:\n  time.sleep(60)\nexcept KeyboardInterrupt: print('how far')"
        outcome = self.python(program, limit=1.0)
        self.assertFalse(outcome.in_time)
        self.assertEqual((outcome.output, outcome.exit_code), ("how far\n", 0))

    def test_a_child_that_was_killed_has_its_signal_as_exit_code(self):
        outcome = self.python("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", limit=60.0)
        self.assertEqual(outcome.exit_code, -signal.SIGKILL)
        self.assertTrue(outcome.in_time)

    def test_memory_is_limited(self):
        program = "import resource; print(resource.getrlimit(resource.RLIMIT_AS)[0])"
        self.assertLess(allowed_memory(), os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
        # The limit is set right after the start, which an interpreter takes longer for.
        self.assertEqual(int(self.python(program).output), int(allowed_memory()))

    def test_what_cannot_be_started_is_an_error(self):
        with self.assertRaises(OSError):
            run_program([str(self.work / "nothing")], self.work)


class CairnTest(unittest.TestCase):
    """Against a program that prints its arguments as JSON."""

    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        program = Path(place.name) / "cairn"
        program.write_text(f"#!{sys.executable}\nimport json, sys\n"
                           "if 'refuse' in sys.argv: sys.exit('cairn: no such graph')\n"
                           "print(json.dumps({'argv': sys.argv[1:], 'graphs': [1]}))\n", encoding="utf-8")
        program.chmod(0o755)
        self.cairn = Cairn(str(program), Path(place.name) / "work")

    def test_a_data_set_brings_its_arguments_and_all_start_from_the_file(self):
        data = DataSet("town", "town.g2o", ["--types", "slam3d"])
        self.assertEqual(self.cairn.optimize(data, ["--iterations", "1"], 2).report["argv"],
                         ["optimize", "town.g2o", "--json", "-", "--quiet", "--threads", "2", "--types", "slam3d",
                          "--iterations", "1", "--initial", "as_given"])
        self.assertEqual(with_start(["--initial", "chordal"]), ["--initial", "chordal"])

    def test_a_run_without_a_report_is_an_error_with_the_complaint(self):
        run = self.cairn.on("replay", DataSet("town", "refuse"), [])
        self.assertIsNone(run.report)
        with self.assertRaisesRegex(Failed, "no such graph"):
            run.required()

    def test_what_cannot_be_measured_is_named_and_left_out(self):
        def fail():
            raise Failed("no such graph")
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            attempt("town", fail)
            attempt("city", lambda: {}["steps"])
        self.assertIn("town left out: no such graph", said.getvalue())
        self.assertIn("city left out: no 'steps'", said.getvalue())


def outcome(seconds, in_time=True):
    return Outcome(in_time=in_time, exit_code=0, seconds=seconds, peak_memory=0.0, output="", complaint="")


class RoundsTest(unittest.TestCase):
    def runs(self, rounds, contestants, seconds):
        """Who ran, in turn; each run takes what `seconds` has for its name, None for too long."""
        order = []

        def run(one):
            order.append(one.name)
            took = seconds[one.name]
            return Run(outcome(took or 0.0, took is not None), {"seconds": took})

        run_rounds(rounds, contestants, run, lambda report: report)
        return "".join(order)

    def test_each_round_begins_with_another_one(self):
        contestants = [Contestant(name) for name in "abc"]
        self.assertEqual(self.runs(3, contestants, dict.fromkeys("abc", 1.0)), "abcbcacab")
        self.assertEqual([len(one.runs) for one in contestants], [3, 3, 3])

    def test_who_was_late_does_not_run_again_and_has_no_run(self):
        contestants = [Contestant(name) for name in "ab"]
        self.assertEqual(self.runs(3, contestants, {"a": None, "b": 1.0}), "abbb")
        self.assertEqual(contestants[0].entry(), {"name": "a", "in_time": False, "limit": 0.0, "runs": []})

    def test_long_runs_are_not_repeated_beyond_what_is_enough(self):
        contestants = [Contestant("a", enough=20.0), Contestant("b", enough=20.0)]
        self.assertEqual(self.runs(5, contestants, {"a": 9.0, "b": 12.0}), "aba")


class DataSetsTest(unittest.TestCase):
    def test_without_a_folder_there_are_generated_graphs_alone(self):
        self.assertEqual([one.name for one in sets_of("threads", None, False)], ["manhattan", "torus", "grid3d 20³"])

    def test_a_graph_whose_truth_is_missing_is_left_out(self):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            (folder / "a.g2o").touch()
            sets = [DataSet("a", "a.g2o"), DataSet("b", "a.g2o", truth="file", truth_file="truth.g2o")]
            self.assertEqual([one.graph for one in located(sets, folder)], [str(folder / "a.g2o")])


class AveragesTest(unittest.TestCase):
    def test_the_median_is_the_middle_or_the_mean_of_the_two_in_it(self):
        self.assertEqual(averages.median([5.0, 1.0, 3.0]), 3.0)
        self.assertEqual(averages.median([4.0, 1.0, 3.0, 100.0]), 3.5)

    def test_a_percentile_is_the_least_value_that_a_part_does_not_exceed(self):
        for part, value in [(0.5, 2.0), (0.51, 3.0), (0.99, 4.0), (0.0, 1.0)]:
            self.assertEqual(averages.percentile([4.0, 1.0, 3.0, 2.0], part), value)

    def test_twice_and_half_are_one_on_average(self):
        self.assertAlmostEqual(averages.geometric_mean([2.0, 0.5]), 1.0, delta=1e-15)
        self.assertAlmostEqual(averages.geometric_mean([2.0, 4.0, 8.0]), 4.0, delta=1e-12)

    def test_the_exponent_of_a_power_law_is_found(self):
        x = [1e4, 1e5, 3e5, 1e6]
        self.assertAlmostEqual(averages.fitted_exponent(x, [3e-7 * v**1.25 for v in x]), 1.25, delta=1e-12)

    def test_of_too_little_there_is_none(self):
        for none in [averages.median([]), averages.percentile([], 0.5), averages.geometric_mean([]),
                     averages.fitted_exponent([1.0], [1.0])]:
            self.assertTrue(math.isnan(none))


class WordsTest(unittest.TestCase):
    def test_three_digits(self):
        self.assertEqual([words.digits(v) for v in [0.0, 1.0, 99.94, 99.96, -123.4, 0.00123456, math.nan]],
                         ["0.00", "1.00", "99.9", "100", "-123", "0.00123", "-"])

    def test_units(self):
        self.assertEqual([words.count(v) for v in [999, 1530000, 2e9]], ["999", "1.53 M", "2 G"])
        self.assertEqual(words.milliseconds(0.0142), "14.2")
        self.assertEqual([words.megabytes(v) for v in [25e6, 0.0]], ["25", "-"])

    def test_how_far_apart(self):
        self.assertEqual([words.apart(1.0, 1.0), words.apart(2.0, 1.0), words.apart(math.nan, 1.0)], ["0", "1e+00", "-"])
        self.assertEqual(words.apart(2e-25, 4e-25, rounding=1e-8), "2e-17")

    def test_as_many_digits_as_the_number_has(self):
        self.assertEqual([words.plain(v) for v in [25.0, 0.005, 3, 0.1 + 0.2]], ["25", "0.005", "3", "0.30000000000000004"])


PAGE = "before\n<!-- table:one -->\nold\n<!-- /table -->\nbetween\n<!-- table:two -->\n<!-- /table -->\nafter\n"


class PagesTest(unittest.TestCase):
    def test_what_stands_between_the_markers_is_replaced_and_nothing_else(self):
        self.assertEqual(pages.put("one", "new\n", PAGE), PAGE.replace("old", "new"))

    def test_a_page_may_be_written_again_with_the_same_result(self):
        once = pages.put("two", "| a |\n", PAGE)
        self.assertEqual(pages.put("two", "| a |\n", once), once)

    def test_a_section_goes_into_the_page_that_has_a_place_for_it(self):
        both = ["nothing\n", PAGE]
        pages.put_into(both, "two", "new\n")
        self.assertEqual(both, ["nothing\n", pages.put("two", "new\n", PAGE)])

    def test_a_table_without_a_place_is_named(self):
        with self.assertRaisesRegex(ValueError, "three"):
            pages.put("three", "x", PAGE)

    def test_the_first_column_is_to_the_left_and_the_others_to_the_right(self):
        lines = pages.table(["name", "value"], [["a", "1.50"], ["b", "-"]]).splitlines()
        self.assertRegex(lines[1], r"^\|:-+\|-+:\|$")
        self.assertEqual([cell.strip() for cell in lines[2].strip("|").split("|")], ["a", "1.50"])

    def test_a_table_may_be_empty(self):
        self.assertEqual(len(pages.table(["name", "value"], []).splitlines()), 2)


    def test_tables_of_a_section_become_tabulars_of_latex(self):
        section = ("Words before.\n\n" + pages.table(["name", "ms & %"], [["a_b", "**1.50 ×**"], ["`c`", "-"]])
                   + "\nbetween | words\n\n" + pages.table(["name"], []))
        self.assertEqual([len(rows) for rows in pages.tables_in(section)], [3, 1])
        first, second = pages.latex(section).split("\n\n")
        lines = first.splitlines()
        self.assertEqual((lines[0], lines[-1]), (r"\begin{tabular}{lr}", r"\end{tabular}"))
        cells = [[cell.strip() for cell in line.rstrip("\\").split(" & ")] for line in lines if " & " in line]
        self.assertEqual(cells, [["name", r"ms \& \%"], [r"a\_b", "1.50 ×"], ["c", "-"]])
        self.assertIn("name", second)
        self.assertEqual(pages.latex("No table.\n"), "")


class CommandLineTest(unittest.TestCase):
    def test_the_name_of_a_group_stands_for_all_of_its_studies(self):
        self.assertTrue(command_line.is_chosen("compact_sets", ["compact"]))
        self.assertFalse(command_line.is_chosen("compact_sets", ["compact_gain", "graphs"]))
        self.assertTrue(command_line.is_chosen("compact_sets", []))

    def test_an_unknown_study_is_refused_with_those_that_there_are(self):
        said = io.StringIO()
        with contextlib.redirect_stderr(said), self.assertRaises(SystemExit) as ended:
            command_line.main(["--folder", "x", "--cairn", "x", "astrology"])
        self.assertEqual(ended.exception.code, 2)
        self.assertIn("scaling", said.getvalue())

    def test_a_study_is_measured_and_written_into_a_page(self):
        """The real program, on its smallest study."""
        said = io.StringIO()
        with tempfile.TemporaryDirectory() as place, contextlib.redirect_stderr(said):
            folder, page = Path(place) / "bench", Path(place) / "page.md"
            ended = command_line.main(["--folder", str(folder), "--cairn", os.environ["CAIRN_PROGRAM"], "--quick", "--rounds", "1",
                                       "--commit", "abc", "threads"])
            # What it said is shown: ctest skips the test where it asks for a plugin that is not built.
            self.assertEqual((ended, (folder / "threads.json").exists()), (0, True), said.getvalue())
            page.write_text("<!-- table:threads -->\n<!-- /table -->\n", encoding="utf-8")
            self.assertEqual(command_line.main(["--folder", str(folder), "--tables", str(page), "--latex", f"{place}/latex"]), 0)
            latex = (Path(place) / "latex" / "threads.tex").read_text(encoding="utf-8")
            entries = json.loads((folder / "threads.json").read_text(encoding="utf-8"))["entries"]
            written = page.read_text(encoding="utf-8")
            full = (Path(place) / "data" / "threads.csv").read_text(encoding="utf-8")
        self.assertGreater(number(entries[0], "one.iteration"), number(entries[0], "one.factorize"))
        factorize = words.milliseconds(number(entries[0], 'two.factorize'))
        self.assertIn(f",{factorize},", full)
        self.assertIn("[threads.csv](data/threads.csv)", written)
        self.assertTrue(latex.startswith(r"\begin{tabular}{l") and factorize in latex and "Quick" not in latex, latex)
        self.assertRegex(written, r"\*Quick run, not a measurement\. .*; commit abc\.\*")

    def test_a_number_that_is_none_is_null_in_json(self):
        self.assertEqual(command_line.finite({"a": [math.nan, 1.0], "b": {"c": math.inf}}), {"a": [None, 1.0], "b": {"c": None}})

    def test_members_that_are_not_there_are_none(self):
        self.assertIsNone(member({"a": [1]}, "a.b"))
        self.assertTrue(math.isnan(number({"a": True}, "a")))


class ArgumentsTest(unittest.TestCase):
    def refusal(self, *words):
        error = io.StringIO()
        with contextlib.redirect_stderr(error), self.assertRaises(SystemExit) as ended:
            command_line.parse(["--folder", "anywhere", *words])
        self.assertEqual(ended.exception.code, 2)
        return error.getvalue()

    def test_what_cannot_be_measured_is_refused_before_anything_is_built(self):
        self.assertIn("there is no study 'nonsense'; there are: graphs", self.refusal("--check", "nonsense"))
        self.assertIn("--data /not/there: there is no such folder", self.refusal("--check", "--data", "/not/there"))
        self.assertIn("--cairn PROGRAM is needed", self.refusal("graphs"))
        self.assertIn("--latex needs --tables PAGE", self.refusal("--cairn", "x", "--latex", "there"))

    def test_arguments_alone_can_be_looked_at(self):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "results"
            self.assertEqual(command_line.main(["--check", "--folder", str(folder), "graphs", "compact"]), 0)
            self.assertFalse(folder.exists())
