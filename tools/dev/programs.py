# SPDX-License-Identifier: BSD-3-Clause
"""Runs all tests of a build, each test program as a whole rather than a process for each test:

    programs.py FOLDER [--jobs N]

Then come the tests that are none of GoogleTest. What fails is named; what a program prints is in PROGRAM.log beside it.
"""
from __future__ import annotations

import argparse
import os
import stat
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import TextIO

LIMIT = "5400"  # of a program [s]


def programs_in(folder: Path) -> list[Path]:
    """The test programs, the largest first, so that none is left alone at the end."""
    found = []
    for file in folder.iterdir():
        status = file.lstat()
        if file.name.endswith(("_test", "_tests")) and stat.S_ISREG(status.st_mode) and status.st_mode & stat.S_IXUSR:
            found.append((status.st_size, file))
    return [file for _, file in sorted(found, reverse=True)]


class Runner:
    """Runs test programs, several at a time."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = environment
        self._running: set[subprocess.Popen[bytes]] = set()

    def passes(self, program: Path) -> bool:
        """Whether all tests of a program do."""
        with program.with_name(program.name + ".log").open("wb") as log:
            # coreutils' timeout ends the children of the program, too.
            with subprocess.Popen(["timeout", LIMIT, program, "--gtest_brief=1"], stdin=subprocess.DEVNULL, stdout=log,
                                  stderr=subprocess.STDOUT, env=self._environment) as child:
                self._running.add(child)
                ended = child.wait()
                self._running.discard(child)
        return ended == 0

    def verdicts(self, programs: list[Path], jobs: int) -> Iterator[tuple[Path, bool]]:
        """Each program, when it has ended, and whether it passes. An interrupt ends all."""
        with ThreadPoolExecutor(jobs) as pool:
            futures = {pool.submit(self.passes, program): program for program in programs}
            try:
                for ended in as_completed(futures):
                    yield futures[ended], ended.result()
            except KeyboardInterrupt:
                pool.shutdown(wait=False, cancel_futures=True)
                for child in list(self._running):
                    child.terminate()
                raise


def run_all(folder: Path, jobs: int, out: TextIO) -> bool:
    """Whether all tests of a build pass. What became of each program is written to `out`, when it has ended."""
    # The plugins of the build, and none that the user has installed.
    environment = {name: value for name, value in os.environ.items() if name != "CAIRN_PLUGIN_PATH"}
    environment["XDG_DATA_HOME"] = str(folder.absolute() / "none")
    passed = True
    for program, passes in Runner(environment).verdicts(programs_in(folder.absolute() / "tests"), jobs):
        print(f"passed: {program.name}" if passes else f"failed: {program.name}, see {program}.log", file=out, flush=True)
        passed = passed and passes
    log = folder / "tests.log"
    with log.open("wb") as output:
        others = subprocess.run(["ctest", "--test-dir", folder, "-j", str(jobs), "-LE", "googletest", "--output-on-failure"],
                                stdout=output, stderr=subprocess.STDOUT, env=environment, check=False)
    if others.returncode != 0:
        print(f"failed: of the other tests, see {log}", file=out, flush=True)
    return passed and others.returncode == 0


def main(words: list[str]) -> int:
    """The exit code."""
    parser = argparse.ArgumentParser(prog="programs", description="Runs all tests of a build.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the build")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="programs at a time [1]")
    given = parser.parse_args(words)
    try:
        return 0 if run_all(given.folder, given.jobs, sys.stdout) else 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
