# SPDX-License-Identifier: BSD-3-Clause
"""The parts of ./dev in tools/dev: tables, test programs, drivers, texts."""
import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "tools/dev"))
import build_times  # noqa: E402
import disturb  # noqa: E402
import line_coverage  # noqa: E402
import programs  # noqa: E402
import texts  # noqa: E402

LOG = """# ninja log v5
0\t2500\t1\tlib/CMakeFiles/cairn_io.dir/io/src/a.cpp.o\taa
10\t60010\t1\tlib/CMakeFiles/cairn_io.dir/io/src/b.cpp.o\tbb
0\t500\t1\tbin/cairn\tcc
0\t500\t1\tbin/link_to_cairn\tcc
0\t99000\t1\t/absolute/CMakeFiles/install.util\tdd
0\t3000\t1\tapps/cairn/CMakeFiles/cairn_app.dir/main.cpp.o\tee
stopped here
"""
TIMES = """1.1 minutes, as long as each command ran; in seconds, by folder:

    62.5     2  lib
     3.0     1  apps/cairn
     0.5     1  linking and the like

the 20 slowest:

    60.0  lib/io/src/b.cpp.o
     3.0  apps/cairn/main.cpp.o
     2.5  lib/io/src/a.cpp.o
     0.5  bin/link_to_cairn"""

COUNTS = """filename,line_total,line_covered,line_percent
core/src/graph.cpp,100,99,0.99
core/include/graph.hpp,100,98,0.98
lib/io/src/g2o.cpp,3,1,0.3
lib/policy/src/p.cpp,7,7,1
solvers/block/src/b.cpp,10,5,0.5
solvers/linear/cholmod/c.cpp,10,0,0
apps/cairn/main.cpp,8,4,0.5
"""
TABLE = """| part | lines | run | |
| --- | ---: | ---: | ---: |
| apps | 8 | 4 | 50.0 % |
| core | 200 | 197 | 98.5 % |
| lib/io | 3 | 1 | 33.3 % |
| lib/policy | 7 | 7 | 100.0 % |
| solvers/block | 10 | 5 | 50.0 % |
| solvers/linear/cholmod | 10 | 0 | 0.0 % |
| in all | 238 | 214 | 89.9 % |"""


class InAFolder(unittest.TestCase):
    """In an empty folder."""

    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(place.name)
        self.place = Path(place.name)


class Tables(InAFolder):
    def test_times_of_a_build(self):
        Path("log").write_text(LOG, encoding="utf-8")
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            self.assertEqual(build_times.main("log", "times"), 0)
        self.assertEqual(out.getvalue(), TIMES + "\n")
        self.assertEqual(Path("times").read_text(encoding="utf-8").splitlines()[-1], "0.500\tbin/link_to_cairn")

    def test_without_a_log_there_are_no_times(self):
        error = io.StringIO()
        with contextlib.redirect_stderr(error):
            self.assertEqual(build_times.main("log", "times"), 1)
        self.assertIn("there is no log; build with Ninja first", error.getvalue())

    def test_lines_of_each_part(self):
        self.assertEqual(line_coverage.table(io.StringIO(COUNTS)), TABLE)


class Programs(InAFolder):
    """A build whose test programs are scripts, and no other tests."""

    def setUp(self):
        super().setUp()
        Path("build/tests").mkdir(parents=True)
        Path("build/CTestTestfile.cmake").touch()

    def program(self, name, text, mode=0o755):
        file = Path("build/tests") / name
        file.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        file.chmod(mode)

    def test_the_largest_come_first_and_nothing_else_counts(self):
        self.program("small_test", "")
        self.program("large_tests", "# large")
        self.program("program", "# larger")
        self.program("no_program_test", "# larger", 0o644)
        Path("build/tests/link_test").symlink_to("large_tests")
        self.assertEqual([file.name for file in programs.programs_in(Path("build/tests"))], ["large_tests", "small_test"])

    @unittest.skipUnless(shutil.which("ctest"), "there is no ctest")
    def test_what_fails_is_named_with_its_log(self):
        self.program("bad_test", 'echo "$@" plugins: $CAIRN_PLUGIN_PATH in $XDG_DATA_HOME; exit 3')
        self.program("good_test", "")
        out = io.StringIO()
        self.assertFalse(programs.run_all(Path("build"), 1, out))
        log = self.place.resolve() / "build/tests/bad_test.log"
        self.assertEqual(out.getvalue(), f"failed: bad_test, see {log}\npassed: good_test\n")
        self.assertEqual(log.read_text(encoding="utf-8"), f"--gtest_brief=1 plugins: in {self.place.resolve()}/build/none\n")
        self.assertTrue(Path("build/tests.log").exists())


class Disturb(unittest.TestCase):
    def test_a_number_that_comes_first_is_a_count_or_minutes(self):
        self.assertEqual(disturb.arguments_of("faults", ["100", "map"]), ["--count", "100", "map"])
        self.assertEqual(disturb.arguments_of("faults", ["map"]), ["map"])
        self.assertEqual(disturb.arguments_of("kill", []), ["--kill", "--count", "1000"])
        self.assertEqual(disturb.arguments_of("kill", ["5", "map"]), ["--kill", "--count", "5", "map"])
        self.assertEqual(disturb.arguments_of("soak", ["0.5", "--seed", "3"]), ["--minutes", "0.5", "--seed", "3"])
        self.assertEqual(disturb.arguments_of("soak", ["--seed", "3"]), ["--seed", "3"])


@unittest.skipUnless(shutil.which("git"), "there is no git")
class Texts(InAFolder):
    def test_paths_of_one_machine_are_found(self):
        subprocess.run(["git", "init", "-q", "."], check=True)
        home = "/" + "home/me"
        for name, text in [("page.md", f"first\nsee {home}/notes\n"), ("script.sh", f"cd ~{home}\n$x{home}\n{home}"),
                           ("LICENSE", home), ("sub/.hidden", "/" + "homeless/x\n"), (".gitignore", "ignored\n"), ("ignored", home)]:
            Path(name).parent.mkdir(exist_ok=True)
            Path(name).write_text(text, encoding="utf-8")
        Path("binary").write_bytes(b"\0" + home.encode())
        self.assertEqual(list(texts.homes(texts.files())), [f"page.md:2:see {home}/notes", f"script.sh:3:{home}"])
        self.assertEqual(texts.files("*.sh", "dev"), ["script.sh"])


if __name__ == "__main__":
    unittest.main()
