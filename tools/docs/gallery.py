# SPDX-License-Identifier: BSD-3-Clause
"""Runs the commands of docs/gallery.md and keeps what they draw, behind `./dev pictures`:

    gallery.py PROGRAMS WORK IMAGES

PROGRAMS: the folder of cairn; WORK: one for the commands, which is emptied. In the root of a checkout. The numbers in
bars and steps are of this machine; all other pictures are the same everywhere.
"""
from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

PAGE = Path("docs/gallery.md")


def commands_in(page: str) -> str:
    """The blocks of commands for a shell, one after the other."""
    return "".join(re.findall(r"^```sh\n(.*?)^```", page, re.MULTILINE | re.DOTALL))


def pictures_in(page: str) -> list[str]:
    """The names of what is shown."""
    return re.findall(r"^!\[.*\]\(images/(.*)\)$", page, re.MULTILINE)


def draw(page: str, programs: Path, work: Path, images: Path) -> int:
    """The exit code of the first command that fails, or 0."""
    shutil.rmtree(work, ignore_errors=True)
    for folder in (images, work):
        folder.mkdir(parents=True, exist_ok=True)
    (work / "commands.sh").write_text("set -euo pipefail\n" + commands_in(page), encoding="utf-8")
    path = f"{programs.absolute()}:{os.environ['PATH']}"
    ended = subprocess.run(["bash", "commands.sh"], cwd=work, env={**os.environ, "PATH": path}, check=False)
    if ended.returncode == 0:
        for picture in pictures_in(page):
            shutil.copy(work / picture, images)
    return ended.returncode if ended.returncode >= 0 else 128 - ended.returncode


def main(programs: str, work: str, images: str) -> int:
    """The exit code."""
    return draw(PAGE.read_text(encoding="utf-8"), Path(programs), Path(work), Path(images))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
