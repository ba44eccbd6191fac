# SPDX-License-Identifier: BSD-3-Clause
"""What a build took, from Ninja's log, behind `./dev build-times`. What ccache had took no time.

    build_times.py LOG TIMES

TIMES: the file for the seconds of every command, the slowest first.
"""
from __future__ import annotations

import re
import sys
from collections import defaultdict
from pathlib import Path

OTHER = "linking and the like"
SLOWEST = 20  # how many are shown


def seconds_in(log: str) -> list[tuple[float, str]]:
    """How long each command of a log ran [s] and the file that it wrote, the slowest first."""
    took, written = {}, {}
    for line in log.splitlines()[1:]:
        fields = line.split("\t")
        if len(fields) != 5:  # Ninja was stopped while it wrote
            continue
        begin, end, _, file, command = fields
        took[file] = (int(end) - int(begin)) / 1000.0  # the last line of a file is that of its last build
        written[begin, end, command] = file  # of several outputs of a command one
    return sorted(((took[file], file) for file in written.values() if not file.startswith("/")), reverse=True)


def folder_of(file: str) -> str:
    """The folder whose target a file belongs to."""
    folder, target, _ = file.partition("/CMakeFiles/")
    return folder if target else OTHER


def tables(times: list[tuple[float, str]]) -> str:
    """In all, by folder, and the slowest files."""
    seconds: dict[str, float] = defaultdict(float)
    files: dict[str, int] = defaultdict(int)
    for took, file in times:
        seconds[folder_of(file)] += took
        files[folder_of(file)] += 1
    rows = sorted(((round(took, 1), files[folder], folder) for folder, took in seconds.items()), reverse=True)
    lines = [f"{sum(took for took, _ in times) / 60.0:.1f} minutes, as long as each command ran; in seconds, by folder:", ""]
    lines += [f"{took:8.1f}  {count:4d}  {folder}" for took, count, folder in rows]
    lines += ["", f"the {SLOWEST} slowest:", ""]
    lines += [f"{took:8.1f}  {re.sub('CMakeFiles/[^/]*/', '', file, count=1)}" for took, file in times[:SLOWEST]]
    return "\n".join(lines)


def main(log: str, times: str) -> int:
    """The exit code."""
    if not Path(log).is_file():
        print(f"./dev build-times: there is no {log}; build with Ninja first", file=sys.stderr)
        return 1
    found = seconds_in(Path(log).read_text(encoding="utf-8"))
    Path(times).write_text("".join(f"{took:.3f}\t{file}\n" for took, file in found), encoding="utf-8")
    print(tables(found))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
