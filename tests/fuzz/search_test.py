# SPDX-License-Identifier: BSD-3-Clause
"""The search behind ./dev fuzz, with programs that say what libFuzzer says."""
import contextlib
import io
import os
import re
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "tests/fuzz"))
import search  # noqa: E402

# Fails as often as the file `fails` says; of what it is to minimize the first byte is left.
TARGET = """#!/bin/sh
echo "${0##*/} $*" >> calls
for word; do
  case $word in
    -exact_artifact_path=*) printf s > "${word#*=}"; exit 1;;
    -max_total_time=*) searching=yes;;
  esac
done
[ "$searching" ] || { echo repeated; exit 77; }
[ ! -e broken ] || { echo no plugin; exit 1; }
echo "#2	INITED cov: 12 ft: 13 corp: 1/1b exec/s: 0 rss: 30Mb"
echo "#9	NEW    cov: 120 ft: 130 corp: 7/70b lim: 4 exec/s: 0 rss: 30Mb"
echo "stat::number_of_executed_units: 600"
left=$(cat fails 2>/dev/null || echo 0)
[ "$left" -gt 0 ] || exit 0
echo $((left - 1)) > fails
printf 'an input' > "build/fuzz/findings/reader-crash-$left"
echo "artifact_prefix='x'; Test unit written to build/fuzz/findings/reader-crash-$left"
exit 77
"""


class SearchTest(unittest.TestCase):
    """A checkout with built targets."""

    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(place.name)
        for build in ("fuzz", "fuzz-fast"):
            for name in ("reader", "grid"):
                self.program(f"build/{build}/bin/fuzz_{name}", TARGET)
            self.program(f"build/{build}/bin/fuzz_seeds", "#!/bin/sh\necho seeds $* >> calls\n")
        for name, words in (("reader", '"word"\n'), ("grid", "")):
            Path(f"build/fuzz/{name}.options").write_text("-max_len=9\n", encoding="utf-8")
            Path(f"build/fuzz/{name}.dict").write_text(words, encoding="utf-8")
        Path("tests/fuzz/regressions/reader").mkdir(parents=True)

    def program(self, name, text):
        file = Path(name)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        file.chmod(0o755)

    def run_with(self, *words):
        """The exit code, standard output and standard error."""
        out, error = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
            code = search.main(list(words))
        return code, out.getvalue(), error.getvalue()

    def calls(self):
        return Path("calls").read_text(encoding="utf-8").splitlines()

    def kept(self, name):
        """What a file of build/fuzz has, without how many seconds it took."""
        lines = Path(f"build/fuzz/{name}").read_text(encoding="utf-8").splitlines()
        return [re.sub(r"^(\w+ \d+) \d+", r"\1", line) for line in lines]

    def test_each_target_gets_its_share_of_the_time_its_words_and_its_corpora(self):
        code, out, error = self.run_with("2", "reader", "grid")
        self.assertEqual((code, error), (0, "reader: 60 s\ngrid: 60 s\n"))
        always = "-timeout=10 -report_slow_units=1 -reload=0 -rss_limit_mb=2048 -print_funcs=0 -print_final_stats=1 -entropic=0"
        self.assertEqual(self.calls(), [
            "seeds build/fuzz",
            "fuzz_reader -max_total_time=60 -max_len=9 -dict=build/fuzz/reader.dict -artifact_prefix=build/fuzz/findings/reader- "
            f"{always} build/fuzz/corpus/reader tests/fuzz/regressions/reader",
            f"fuzz_grid -max_total_time=60 -max_len=9 -artifact_prefix=build/fuzz/findings/grid- {always} "
            "build/fuzz/corpus/grid"])
        self.assertEqual(out.splitlines()[1].split()[:2], ["target", "executions"])
        self.assertEqual(self.kept("run"), ["reader 600 120 130 7 0", "grid 600 120 130 7 0"])

    def test_executions_add_up_from_run_to_run(self):
        self.run_with("1", "reader")
        _, out, _ = self.run_with("1", "reader", "grid")
        self.assertEqual(self.kept("totals"), ["reader 600 0", "reader 600 0", "grid 600 0"])
        self.assertEqual([(row[0], row[1], row[7]) for row in (line.split() for line in out.splitlines()[2:])],
                         [("reader", "600", "1200"), ("grid", "600", "600")])
        self.run_with("--fast", "1", "grid")
        self.assertEqual(self.kept("totals-fast"), ["grid 600 0"])

    def test_three_inputs_are_enough_and_each_is_made_smaller(self):
        Path("fails").write_text("5", encoding="utf-8")
        code, _, error = self.run_with("5", "reader")
        self.assertEqual(code, 1)
        names = [f"build/fuzz/findings/reader-crash-{left}" for left in (3, 4, 5)]
        self.assertEqual(error.splitlines()[-3:], [f"1 {name}" for name in names])
        self.assertIn("; build/fuzz/bin/fuzz_TARGET FILE repeats one:", error)
        self.assertEqual([Path(f"{name}.log").read_text(encoding="utf-8") for name in names], ["repeated\n"] * 3)
        self.assertEqual(self.kept("run"), ["reader 1800 120 130 7 3"])
        self.assertEqual(sum("-minimize_crash=1" in call for call in self.calls()), 3)

    def test_a_program_that_does_not_begin_is_no_finding(self):
        Path("broken").touch()
        self.assertEqual(self.run_with("1", "grid"),
                         (1, "", "grid: 60 s\nbuild/fuzz/bin/fuzz_grid ends before its first input:\nno plugin\n"))
        self.assertFalse(Path("build/fuzz/totals").exists())

    def test_slow_inputs_are_named(self):
        Path("build/fuzz/findings").mkdir()
        Path("build/fuzz/findings/grid-slow-unit-1").touch()
        _, _, error = self.run_with("1", "grid")
        self.assertIn("grid: inputs that took longer than a second: build/fuzz/findings/grid-slow-unit-*\n", error)


class ArgumentsTest(unittest.TestCase):
    def test_time_is_shared_by_the_targets(self):
        self.assertEqual(search.parse([]).targets, list(search.TARGETS))
        self.assertEqual(search.parse(["2.5", "grid", "reader"]).seconds, 75)
        self.assertEqual(search.parse(["0.001"]).seconds, 1)
        self.assertEqual(search.parse(["--check", "--fast", "reader"]).preset, "fuzz-fast")

    def test_an_unknown_target_is_refused_with_those_that_there_are(self):
        error = io.StringIO()
        with contextlib.redirect_stderr(error):
            self.assertEqual(search.main(["--check", "1", "nonsense"]), 2)
        self.assertTrue(error.getvalue().startswith("./dev fuzz: no target 'nonsense'; there are: reader packed_file"))

    def test_the_targets_are_those_that_are_built(self):
        built = (SOURCE / "tests/fuzz/targets/CMakeLists.txt").read_text(encoding="utf-8")
        self.assertEqual(re.search(r"set\(targets ([\w ]+)\)", built)[1].split(), list(search.TARGETS))


if __name__ == "__main__":
    unittest.main()
