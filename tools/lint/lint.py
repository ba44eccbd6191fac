# SPDX-License-Identifier: BSD-3-Clause
"""clang-tidy on sources that are not known to be clean, behind `./dev lint`.

    lint.py [--packages NAME...] -- [FILE...]

In the root of a checkout whose build/release is configured. A source that was found clean is not looked at again until
its key changes (keys.py); what is clean is kept for all checkouts of a user. FILE: only these sources.
"""
from __future__ import annotations

import argparse
import contextlib
import os
import sys
import time
from pathlib import Path

import keys
import tidy

FOLDER = Path("build/lint")
KEPT = 60  # days after a file was last found clean
# Those of g++ that clang does not know; and whether g++ ends at a warning is the same to it.
LEFT_OUT = (" -Werror", " -fno-gnu-unique", " -Wno-restrict", " -Wno-maybe-uninitialized", " -Winvalid-pch", " -fpch-preprocess")


def for_clang(database: str) -> str:
    """A compilation database of g++, with flags that clang takes."""
    for flag in LEFT_OUT:
        database = database.replace(flag, "")
    return database


def cache() -> Path:
    """The folder of what was found clean: an empty file for each key."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "cairn" / "lint"


def unknown(sources: dict[str, str], clean: Path) -> dict[str, str]:
    """Of sources and their keys those that were not found clean. The others are as good as new in the cache."""
    todo = {}
    for file, key in sources.items():
        if (clean / key).exists():
            (clean / key).touch()
        else:
            todo[file] = key
    return todo


def forget(clean: Path) -> None:
    """Takes from the cache what nobody has asked for in a long time."""
    for file in clean.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another checkout does the same
            if (time.time() - file.stat().st_mtime) // 86400 > KEPT:
                file.unlink()


def main(words: list[str]) -> int:
    """The exit code."""
    parser = argparse.ArgumentParser(prog="lint", description="Runs clang-tidy on what is not known to be clean.")
    parser.add_argument("--packages", nargs="*", default=[], metavar="NAME", help="Debian's, whose headers sources include")
    parser.add_argument("files", nargs="*", metavar="FILE", help="only these sources")
    given = parser.parse_args(words)
    clean = cache()
    for folder in (FOLDER, clean):
        folder.mkdir(parents=True, exist_ok=True)
    database = FOLDER / "compile_commands.json"
    database.write_text(for_clang(Path("build/release/compile_commands.json").read_text(encoding="utf-8")), encoding="utf-8")
    sources = keys.keys_of(Path.cwd(), database.read_text(encoding="utf-8"), keys.versions(given.packages))
    (FOLDER / "keys").write_text("".join(f"{key} {file}\n" for file, key in sources.items()), encoding="utf-8")
    if given.files:
        sources = {file: key for file, key in sources.items() if file in given.files}
    todo = unknown(sources, clean)
    forget(clean)
    print(f"lint: clang-tidy on {len(todo)} of {len(sources)} files", file=sys.stderr, flush=True)
    return tidy.check_all(database, clean, todo) if todo else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
