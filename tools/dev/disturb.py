# SPDX-License-Identifier: BSD-3-Clause
"""Calls the drivers that disturb cairn, behind `./dev faults`, `./dev kill` and `./dev soak`:

    disturb.py BUILD faults|kill|soak [ARGUMENT...]

Failures are injected by a library that the tests build, and the drivers beside it. A number that comes first is a
count of failures or of kills, or minutes.
"""
from __future__ import annotations

import os
import re
import sys
from pathlib import Path

KILLS = "1000"  # where no number is given


def arguments_of(command: str, words: list[str]) -> list[str]:
    """Those of the driver."""
    first = words[0] if words else ""
    if command == "kill":
        return ["--kill", "--count", *([] if re.fullmatch("[0-9]+", first) else [KILLS]), *words]
    if command == "faults":
        return ["--count", *words] if re.fullmatch("[0-9]+", first) else words
    return ["--minutes", *words] if re.fullmatch("[0-9.]+", first) else words


def main(build: str, command: str, *words: str) -> None:
    """Becomes the driver."""
    tests = Path(build).absolute() / "tests"
    driver = str(tests / ("cairn_soak" if command == "soak" else "cairn_faults"))
    os.execv(driver, [driver, "--program", f"{build}/bin/cairn", "--library", str(tests / "cairn_injected_faults.so"),
                      "--folder", f"build/{command}", *arguments_of(command, list(words))])


if __name__ == "__main__":
    main(*sys.argv[1:])
