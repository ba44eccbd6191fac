# SPDX-License-Identifier: BSD-3-Clause
"""What `./dev bench` does with the program it has built: measures, and writes pages and pictures of the documentation.

    python3 -m bench.full_run CAIRN [ARGUMENT...]

ARGUMENT: as of `python3 -m bench`. In the root of a checkout; with --quick pages, CSV files and pictures are copies in
build/bench/quick.
"""
from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from . import command_line, pictures

PAGES = [Path("docs") / name for name in ("performance.md", "compact_results.md", "sparsify_results.md", "explore_results.md")]


def measured_commit() -> str:
    """Nothing outside of a repository."""
    try:
        described = subprocess.run(["git", "describe", "--always", "--dirty"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                                   text=True, check=False)
    except OSError:
        return ""
    return described.stdout.strip() if described.returncode == 0 else ""


def use_wide_vectors() -> None:
    """Debian's OpenBLAS does not know newer processors, and would measure CHOLMOD and itself without their AVX-512."""
    processor = Path("/proc/cpuinfo")
    if not os.environ.get("OPENBLAS_CORETYPE") and processor.exists() and "avx512f" in processor.read_text().split():
        os.environ["OPENBLAS_CORETYPE"] = "SkylakeX"


def main(words: list[str]) -> int:
    """The exit code: that of the first part that fails."""
    cairn, *arguments = words
    folder, images, pages = Path("build/bench"), Path("docs/images"), PAGES
    if "--quick" in arguments:
        folder = folder / "quick"
        images = folder / "images"
        images.mkdir(parents=True, exist_ok=True)
        pages = [Path(shutil.copy(page, folder)) for page in PAGES]
    use_wide_vectors()
    begin = ["--folder", str(folder)]
    shown = [str(page) for page in pages]
    failed = (command_line.main([*begin, "--cairn", cairn, "--commit", measured_commit(), *arguments])
              or command_line.main([*begin, "--tables", *shown, "--latex", f"{folder}/latex"])
              or pictures.main([cairn, str(folder), str(images)]))
    if not failed:
        print(f"\n{' '.join(shown)} have the tables in short, {pages[0].parent}/data/*.csv in full, {folder}/latex in LaTeX, "
              f"{folder}/*.json every run.")
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
