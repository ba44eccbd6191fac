#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs clang-tidy on sources, several in one run, and remembers which are clean.

    tidy.py DATABASE CLEAN < lines "key file"

Parsing Eigen and the standard library takes most of the time of clang-tidy. So sources that are compiled with the same flags
and checked alike are put one after the other into one file, and parsed with it once; #line says which is which, so that all of
them count as the main file, for which the compiler has warnings of its own. Where that finds anything, or names of two of them
clash, each half is tried by itself, down to single files, whose verdict counts. What is clean is an empty file CLEAN/key.

One thing is not seen so: an #include that only an earlier source has. A compiler sees it where no precompiled header hides it;
a source that is compiled with one is parsed by itself too.
"""

import json
import os
import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

TOGETHER = 8
# What the compiler itself says; clang-tidy wants a check besides, and this one costs nothing.
OF_COMPILER = "-*,clang-diagnostic-*,bugprone-suspicious-include"
# A #define between two sources, since an #include may be repeated after one (readability-duplicate-include).
BETWEEN = "#define CAIRN_LINT_NEXT_SOURCE\n#undef CAIRN_LINT_NEXT_SOURCE\n"


@dataclass
class Source:
    """A source of the compilation database."""

    file: str  # relative to the root
    key: str
    folder: str  # where it is compiled
    flags: list[str]
    precompiled: bool  # with a precompiled header


@dataclass
class Result:
    """What became of a group: its clean sources, and what was printed of the others."""

    clean: list[Source] = field(default_factory=list)
    output: list[str] = field(default_factory=list)


def read_flags(command: str, file: str) -> list[str]:
    """The flags of a compiler's command, without the compiler, the source, the output and a precompiled header."""
    words = shlex.split(command)
    flags: list[str] = []
    at = next(k for k, word in enumerate(words) if word.startswith("-"))
    while at < len(words):
        word = words[at]
        if word in ("-o", "-MF", "-MT", "-MQ") or word == "-include" and words[at + 1].endswith("cmake_pch.hxx"):
            at += 2
            continue
        if word not in ("-c", "-MD", "-MMD", file):
            flags.append(word)
        at += 1
    return flags


def read_sources(database: Path, root: Path, keys: dict[str, str]) -> list[Source]:
    """Those of the database that have a key."""
    sources = {}
    for entry in json.loads(database.read_text()):
        file = os.path.relpath(os.path.join(entry["directory"], entry["file"]), root)
        if file in keys and file not in sources:
            command = entry["command"]
            sources[file] = Source(file, keys[file], entry["directory"], read_flags(command, entry["file"]), "cmake_pch.hxx" in command)
    return [sources[file] for file in sorted(sources)]


def nearest_configuration(root: Path, file: str) -> str:
    """The .clang-tidy that holds for a file."""
    folder = (root / file).parent
    while folder != root and not (folder / ".clang-tidy").exists():
        folder = folder.parent
    return str(folder / ".clang-tidy")


def in_groups(root: Path, sources: list[Source]) -> list[list[Source]]:
    """Sources with equal flags, compiled at the same place and checked alike, at most TOGETHER in each, the largest first."""
    alike: dict[tuple, list[Source]] = {}
    for source in sources:
        alike.setdefault((source.folder, nearest_configuration(root, source.file), *source.flags), []).append(source)
    groups = []
    for same in alike.values():
        count = -(-len(same) // TOGETHER)
        groups += [same[len(same) * k // count:len(same) * (k + 1) // count] for k in range(count)]
    return sorted(groups, key=len, reverse=True)


def as_part(path: Path) -> str:
    """A source's text as a part of another file, elsewhere."""
    def found(include: re.Match[str]) -> str:
        beside = path.parent / include[2]
        return f'{include[1]}"{beside}"' if beside.is_file() else include[0]

    text = re.sub(r'^( *# *include *)"([^"]+)"', found, path.read_text(), flags=re.MULTILINE)
    return f'{BETWEEN}#line 1 "{path}"\n{text}\n'


class Linter:
    """clang-tidy with the configuration of a checkout; `work`: a folder below its root for files of its own."""

    def __init__(self, root: Path, work: Path):
        self.root = root
        self.work = work

    def check(self, group: list[Source]) -> Result:
        """Together, and where that is not clean each half."""
        if len(group) == 1:
            return self._check_one(group[0])
        unit = self.work / f"{group[0].key}.cpp"
        unit.write_text("".join(as_part(self.root / source.file) for source in group))
        output = self._tidy(unit, group[0], f"--config-file={nearest_configuration(self.root, group[0].file)}")
        unit.unlink()
        if output is None:
            return self._includes(group)
        half = len(group) // 2
        first, second = self.check(group[:half]), self.check(group[half:])
        return Result(first.clean + second.clean, first.output + second.output)

    def _check_one(self, source: Source) -> Result:
        output = self._tidy(self.root / source.file, source)
        return Result([source]) if output is None else Result(output=[output])

    def _includes(self, group: list[Source]) -> Result:
        """Sources that are clean together, each parsed by itself if a precompiled header hides from the compiler what it lacks."""
        result = Result()
        for source in group:
            output = self._tidy(self.root / source.file, source, f"--checks={OF_COMPILER}") if source.precompiled else None
            if output is None:
                result.clean.append(source)
            else:
                result.output.append(output)
        return result

    def _tidy(self, file: Path, source: Source, *options: str) -> str | None:
        """What clang-tidy says of a file that is compiled as the source is; None: nothing."""
        done = self._run(source, ["clang-tidy", "--quiet", *options, str(file), "--", *source.flags])
        if done.returncode == 0:
            return None
        return "\n".join(line for line in done.stdout.splitlines() if not re.fullmatch(r"\d+ warnings? generated\.", line))

    def _run(self, source: Source, command: list[str]) -> subprocess.CompletedProcess[str]:
        return subprocess.run(command, cwd=source.folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)


def main(database: str, clean: str) -> int:
    """Of the whole: the exit code."""
    root = Path.cwd()
    work = Path(database).parent / "units"
    work.mkdir(parents=True, exist_ok=True)
    keys = {}
    for line in sys.stdin:
        key, file = line.split()
        keys[file] = key
    linter = Linter(root, work.resolve())
    failed = False
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for result in pool.map(linter.check, in_groups(root, read_sources(Path(database), root, keys))):
            for source in result.clean:
                (Path(clean) / source.key).touch()
            for text in result.output:
                print(text, flush=True)
                failed = True
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
