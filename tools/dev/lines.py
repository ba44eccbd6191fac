# SPDX-License-Identifier: BSD-3-Clause
"""Lines by layer, of C++ that is the product and of tests, public headers, and words of pages: a table.

    python3 tools/dev/lines.py [FOLDER]    FOLDER: a checkout; default: that of this file

Sources and headers count with their comments and empty lines. What one has to know to change a solver are the layers up to
the program without a subject that needs a robot or a policy.
"""
from __future__ import annotations

import pathlib
import subprocess
import sys

CPP = (".cpp", ".hpp", ".h")
# Of the subjects, those that every graph needs.
SMALL = ["formats", "generate", "initial"]


def tracked(folder: pathlib.Path) -> list[pathlib.PurePosixPath]:
    """The files of a checkout, as paths relative to it."""
    names = subprocess.run(["git", "-C", str(folder), "ls-files", "-z"], check=True, capture_output=True).stdout
    return [pathlib.PurePosixPath(name) for name in names.decode().split("\0") if name]


def place(path: pathlib.PurePosixPath) -> str:
    """The layer or subject that a file belongs to."""
    parts = path.parts
    if parts[0] == "plugins" and len(parts) > 2:
        return "/".join(parts[:2])
    if parts[0] in ("apps", "lib") and len(parts) > 2:
        return "/".join(parts[:2]) if parts[0] == "apps" or parts[1] in ("program", "report") else parts[0]
    return parts[0]


def count(folder: pathlib.Path) -> tuple[dict[str, int], dict[str, int], int, int]:
    """Lines of C++ and public headers by place, lines of tests, and words of pages."""
    lines: dict[str, int] = {}
    headers: dict[str, int] = {}
    tests = words = 0
    for path in tracked(folder):
        file = pathlib.Path(folder, path)
        if not file.is_file():
            continue
        if path.suffix == ".md":
            words += len(file.read_text(encoding="utf-8").split())
        if path.suffix not in CPP + (".py",):
            continue
        number = file.read_bytes().count(b"\n")
        if path.parts[0] == "tests":
            tests += number
        elif path.suffix in CPP and path.parts[0] not in ("tools", "examples", "share"):
            lines[place(path)] = lines.get(place(path), 0) + number
            if "/include/cairn/" in f"/{path}":
                headers[place(path)] = headers.get(place(path), 0) + 1
    return lines, headers, tests, words


def report(folder: pathlib.Path) -> str:
    """The table, as text."""
    lines, headers, tests, words = count(folder)
    known = ["core", "lib", "lib/report", "lib/program", "types", "solvers", *(f"plugins/{name}" for name in SMALL), "apps/cairn"]
    rows = [(name, lines[name], headers.get(name, 0)) for name in [*known, *sorted(set(lines) - set(known))] if name in lines]
    text = [f"{'':24}{'lines':>9}{'public headers':>16}"]
    for name, number, public in rows:
        text.append(f"{name:24}{number:>9}{public or '':>16}")
    text.append(f"{'to change a solver':24}{sum(lines.get(name, 0) for name in known):>9}")
    text.append(f"{'the product':24}{sum(lines.values()):>9}{sum(headers.values()):>16}")
    text.append(f"{'tests':24}{tests:>9}")
    text.append(f"{'words of pages':24}{words:>9}")
    return "\n".join(text)


if __name__ == "__main__":
    print(report(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]))
