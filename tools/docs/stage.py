# SPDX-License-Identifier: BSD-3-Clause
"""Gathers what Sphinx reads: the pages of the repository as they are, and pages that are generated from what is built.

    stage.py FOLDER --cairn PROGRAM [--python FOLDER] [--doxygen XML]

Pages keep their places, so that links between them are those of the repository. Links to other files become downloads,
links to folders plain text. A link to what is not there is an error. `docs/index.md` has the order of the pages: each list
below a heading becomes a part of the navigation.
"""
import argparse
import os
import re
import shutil
import sys
from pathlib import Path

import commands
import components
import headers
import python_names

SOURCE = Path(__file__).resolve().parents[2]
PAGES = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "LICENSE"]
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+(?:\([^()]*\))?)\)")
FENCE = re.compile(r"^(```.*?^```[^\S\n]*$)", re.MULTILINE | re.DOTALL)


def anchors(text):
    """What links to a page can name after '#': its headings, as a forge and MyST make anchors of them, and explicit ones."""
    prose = "".join(FENCE.split(text)[::2])
    found, times = set(re.findall(r'<a (?:id|name)="([^"]+)"', prose)), {}
    for heading in re.findall(r"^#{1,6} (.*)$", prose, re.MULTILINE):
        words = LINK.sub(lambda match: match.group(2), heading).replace("`", "").strip().lower()
        anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        found.add(f"{anchor}-{times[anchor]}" if anchor in times else anchor)
        times[anchor] = times.get(anchor, 0) + 1
    return found


class Stage:
    def __init__(self, folder):
        self.folder = folder
        self.wrong = []

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def page(self, name):
        """A page of the repository, with its links checked."""
        source = SOURCE / name

        # Fenced blocks are left as they are.
        def link(match):
            return self.link(match, source)

        text = source.read_text(encoding="utf-8")
        parts = FENCE.split(text)
        parts[::2] = [LINK.sub(link, part) for part in parts[::2]]
        self.write(name, "".join(parts))

    def link(self, match, source):
        picture, text, target = match.groups()
        if re.match(r"[a-z]+:", target):
            return match.group(0)
        path, _, anchor = target.partition("#")
        there = (source.parent / path).resolve() if path else source
        try:
            name = there.relative_to(SOURCE)
        except ValueError:
            name = None
        if name is None or not there.exists():
            self.wrong.append(f"{source.relative_to(SOURCE)}: {target} is not there")
            return text
        if there.is_dir():
            return text
        if anchor and there.suffix == ".md" and anchor not in anchors(there.read_text(encoding="utf-8")):
            self.wrong.append(f"{source.relative_to(SOURCE)}: {path or source.name} has no heading for #{anchor}")
        if not path:
            return match.group(0)
        if str(name) == "docs/index.md":  # the first page of the site, at its top
            anchor = f"#{anchor}" if anchor else ""
            return f"{picture}[{text}]({os.path.relpath(SOURCE / 'index.md', source.parent)}{anchor})"
        if there.suffix == ".md" and (str(name) in PAGES or name.parts[0] == "docs"):
            return match.group(0)
        copy = self.folder / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(there, copy)
        if there.suffix == ".md":  # no page of the site: its text can be had as a file
            copy = copy.rename(copy.with_suffix(".md.txt"))
            return f"{picture}[{text}]({path}.txt)"
        return f"{picture}[{text}]({path})"


def navigation(text, generated):
    """The parts of docs/index.md: a heading, and the pages that its list links to."""
    trees = []
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        heading, body = part.split("\n", 1)
        pages = [str(Path(os.path.normpath("docs/" + match.group(3).partition("#")[0]))) for match in LINK.finditer(body)]
        pages = list(dict.fromkeys(page[: -len(".md")] for page in pages if page.endswith(".md")))
        pages += generated.get(heading, [])
        trees.append(f"```{{toctree}}\n:hidden:\n:caption: {heading}\n\n" + "\n".join(pages) + "\n```\n")
    return trees


def rebased(text):
    """docs/index.md becomes the first page of the site, one folder higher."""
    return LINK.sub(lambda m: m.group(0) if ":" in m.group(3) else f"{m.group(1)}[{m.group(2)}]({os.path.normpath('docs/' + m.group(3))})", text)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cairn", required=True, help="the program, which tells of commands and components")
    parser.add_argument("--python", default="", help="folder of the Python package; empty: no reference of it")
    parser.add_argument("--doxygen", type=Path, help="folder of Doxygen's XML; without it no reference of C++")
    given = parser.parse_args()
    shutil.rmtree(given.folder, ignore_errors=True)
    stage = Stage(given.folder)
    pages = [name for name in PAGES if name.endswith(".md")] + sorted(f"docs/{p.name}" for p in (SOURCE / "docs").glob("*.md") if p.name != "index.md")
    for name in pages:
        stage.page(name)
    if (SOURCE / "docs" / "images").exists():
        shutil.copytree(SOURCE / "docs" / "images", given.folder / "docs" / "images", dirs_exist_ok=True)
    generated = {"Components": components.write(stage, given.cairn), "Reference": commands.write(stage, given.cairn)}
    if given.python:
        generated["Reference"] += python_names.write(stage, given.python)
    if given.doxygen:
        generated["Reference"] += headers.write(stage, SOURCE, given.doxygen)
    index = (SOURCE / "docs" / "index.md").read_text(encoding="utf-8")
    LINK.sub(lambda match: stage.link(match, SOURCE / "docs" / "index.md"), index)
    trees = navigation(index, generated)
    stage.write("index.md", rebased(index) + "\n" + "\n".join(trees))
    named = set(re.findall(r"^\S+$", "\n".join(trees), re.MULTILINE))
    stage.wrong += [f"docs/index.md does not link to {name}" for name in pages if name[: -len(".md")] not in named]
    for line in stage.wrong:
        print(line, file=sys.stderr)
    return 1 if stage.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
