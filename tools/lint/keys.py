# SPDX-License-Identifier: BSD-3-Clause
"""A key of each source: a hash of everything that can change what clang-tidy says of it.

That is the source itself, every header that it may include, the files with the checks, tools/lint, how the source is
compiled, and the versions of clang-tidy and of the packages whose headers it includes. Nothing of it depends on where
the checkout lies, so that all checkouts share what was found clean, nor on the folders in it: what has moved as it is
stays clean.
"""
from __future__ import annotations

import hashlib
import json
import re
import shlex
import subprocess
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

SOURCES = ("*.cpp", "*.hpp")
# The files with the checks, and what puts sources together; not what Python makes of the latter.
CONFIGURATION = (".clang-tidy", "*/.clang-tidy", "tools/lint", ":(exclude)*.pyc")
INCLUDE = re.compile(rb'^ *# *include *"([^"\n]+)"', re.MULTILINE)


def contents(root: Path, patterns: Iterable[str]) -> dict[str, bytes]:
    """What the files of a checkout have that git would take by these patterns, also those not yet added to it."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *patterns], cwd=root,
                            stdout=subprocess.PIPE, text=True, check=True).stdout
    return {name: (root / name).read_bytes() for name in sorted(listed.split("\0")) if name and (root / name).is_file()}


def included(text: bytes) -> set[str]:
    """The ends of paths that the quoted #includes of a file name."""
    return {name.decode(errors="replace").rpartition("../")[2] for name in INCLUDE.findall(text)}


class Includes:
    """Which files of a checkout may include which. An #include stands for every file whose path ends so: a few too
    many, and none too few."""

    def __init__(self, texts: dict[str, bytes]) -> None:
        by_end = defaultdict(set)
        for file in texts:
            parts = file.split("/")
            for k in range(len(parts)):
                by_end["/".join(parts[k:])].add(file)
        self._direct = {file: {found for name in included(text) for found in by_end.get(name, ())}
                        for file, text in texts.items()}

    def reached(self, file: str) -> set[str]:
        """The file, and all that it may include, also through others."""
        reached, todo = {file}, [file]
        while todo:
            found = self._direct[todo.pop()] - reached
            reached |= found
            todo += found
        return reached


def flags_of(command: str) -> str:
    """A compiler's command without names of files and folders: what is found in them is in the key by itself."""
    words = iter(shlex.split(command)[1:])
    flags = []
    for word in words:
        if word in ("-o", "-c", "-isystem", "-MF", "-MT", "-MQ", "-include"):
            next(words)
        elif word.startswith("-") and not word.startswith("-I"):
            flags.append(word)
    return " ".join(flags)


def commands_in(database: str, root: Path) -> dict[str, list[str]]:
    """How each source is compiled, by a compilation database in JSON, without places."""
    result = defaultdict(list)
    for entry in json.loads(database):
        file, command = (entry[name].replace(f"{root}/", "") for name in ("file", "command"))
        result[file].append(flags_of(command))
    return result


def versions(packages: Iterable[str]) -> bytes:
    """Of clang-tidy and of Debian's packages; of none where there is no dpkg."""
    tidy = subprocess.run(["clang-tidy", "--version"], stdout=subprocess.PIPE, check=False).stdout
    try:
        return tidy + subprocess.run(["dpkg-query", "-W", *packages], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                                     check=False).stdout
    except FileNotFoundError:
        return tidy


def keys_of(root: Path, database: str, tools: bytes) -> dict[str, str]:
    """The key of each source that is compiled here and now; one whose plugin is left out is not. `tools`: their
    versions."""
    texts = contents(root, SOURCES)
    hashes = {file: hashlib.sha256(text).hexdigest() for file, text in texts.items()}
    common = hashlib.sha256(tools)
    for text in contents(root, CONFIGURATION).values():
        common.update(text)
    includes = Includes(texts)
    result = {}
    for file, commands in sorted(commands_in(database, root).items()):
        if file in texts:  # rather than written by CMake
            parts = [common.hexdigest(), "tests" if file.startswith("tests/") else "", *commands, hashes[file],
                     *sorted(f"{Path(each).name} {hashes[each]}" for each in includes.reached(file))]
            result[file] = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    return result
