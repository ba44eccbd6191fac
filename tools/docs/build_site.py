# SPDX-License-Identifier: BSD-3-Clause
"""The documentation site, behind `./dev docs`: Doxygen reads the headers, stage.py gathers the pages, Sphinx makes HTML.

    build_site.py FOLDER --cairn PROGRAM [--python FOLDER]

In the root of a checkout. The site is in FOLDER/html; a warning, or a link that leads nowhere, is an error.
"""
from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path("tools/docs")


def build(folder: Path, stage: list[str]) -> None:
    """`stage`: what stage.py is told of the program and the package. Raises CalledProcessError at the first step that
    fails."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in ("xml", "html"):
        shutil.rmtree(folder / part, ignore_errors=True)
    doxyfile = (HERE / "Doxyfile").read_text(encoding="utf-8") + f"OUTPUT_DIRECTORY = {folder}\n"
    subprocess.run(["doxygen", "-"], input=doxyfile, text=True, check=True)
    # Without the plugins that the user has installed.
    subprocess.run([sys.executable, "-B", HERE / "stage.py", folder / "source", *stage, "--doxygen", folder / "xml"],
                   env={**os.environ, "XDG_DATA_HOME": str(folder.absolute() / "none")}, check=True)
    # -W: warnings are errors; -E: nothing of an earlier build is used.
    subprocess.run([sys.executable, "-B", "-m", "sphinx", "-W", "--keep-going", "-E", "-q", "-b", "html", "-c", HERE,
                    "-d", folder / "doctrees", folder / "source", folder / "html"],
                   env={**os.environ, "CAIRN_DOXYGEN_XML": str(folder.absolute() / "xml")}, check=True)


def main(words: list[str]) -> int:
    """The exit code: that of the step that fails."""
    parser = argparse.ArgumentParser(prog="build_site", description="Builds the documentation site.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the site and of what it is made from")
    parser.add_argument("--cairn", required=True, metavar="PROGRAM", help="the program, which tells of commands and components")
    parser.add_argument("--python", metavar="FOLDER", help="of the Python package")
    given = parser.parse_args(words)
    try:
        build(given.folder, ["--cairn", given.cairn, *(["--python", given.python] if given.python else [])])
    except subprocess.CalledProcessError as error:
        return error.returncode if error.returncode > 0 else 128 - error.returncode
    print(f"open in a browser: {given.folder.absolute()}/html/index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
