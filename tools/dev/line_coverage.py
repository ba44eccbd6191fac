# SPDX-License-Identifier: BSD-3-Clause
"""Which lines the tests run, behind `./dev coverage`:

    line_coverage.py FOLDER [--jobs N]

Of a build that counts; FOLDER/files.csv and FOLDER/lines.txt have each file, and a table of the parts is printed. Test
programs run as a whole, since counts are written at the end of each process. What fails is shown by ./dev test.
"""
from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import programs

COUNTED = ("core", "lib", "types", "solvers", "plugins", "apps")


def part_of(file: str) -> str:
    """The part of the project that a file belongs to: "core", "lib/io", "solvers/linear/cholmod"."""
    folders = file.split("/")
    if folders[0] in ("core", "apps"):
        return folders[0]
    depth = 3 if folders[0] == "solvers" and folders[1] != "block" else 2
    return "/".join(folders[:depth])


def table(lines: Iterable[str]) -> str:
    """In Markdown, of what gcovr writes as CSV: file, lines, those that run, …"""
    total: dict[str, int] = defaultdict(int)
    run: dict[str, int] = defaultdict(int)
    for file, count, ran, *_ in list(csv.reader(lines))[1:]:
        for part in (part_of(file), "in all"):
            total[part] += int(count)
            run[part] += int(ran)
    parts = sorted(part for part in total if part != "in all")
    rows = [f"| {part} | {total[part]} | {run[part]} | {100.0 * run[part] / total[part]:.1f} % |" for part in [*parts, "in all"]]
    return "\n".join(["| part | lines | run | |", "| --- | ---: | ---: | ---: |", *rows])


def count(folder: Path, jobs: int) -> int:
    """Runs the tests of a build and counts their lines in files.csv and lines.txt. The exit code of gcovr."""
    for counts in folder.rglob("*.gcda"):
        counts.unlink()
    programs.run_all(folder, jobs, sys.stderr)
    filters = [word for part in COUNTED for word in ("--filter", f"{part}/")]
    return subprocess.run(["gcovr", "--root", ".", "--object-directory", folder, "--exclude-throw-branches", "-j", str(jobs),
                           *filters, "--gcov-ignore-parse-errors", "--csv", folder / "files.csv", "--txt", folder / "lines.txt"],
                          check=False).returncode


def main(words: list[str]) -> int:
    """The exit code: that of gcovr."""
    parser = argparse.ArgumentParser(prog="line_coverage", description="Which lines the tests of a build run.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the build")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes at a time [1]")
    given = parser.parse_args(words)
    try:
        failed = count(given.folder, given.jobs)
    except KeyboardInterrupt:
        return 130
    if failed:
        return failed
    with (given.folder / "files.csv").open(encoding="utf-8", newline="") as found:
        print(table(found), flush=True)
    print(f"\nlines that do not run, by file: {given.folder / 'lines.txt'}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
