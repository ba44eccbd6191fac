# SPDX-License-Identifier: BSD-3-Clause
"""Runs clang-tidy on sources, several in one run, and remembers which are clean.

Parsing Eigen and the standard library takes most of the time of clang-tidy. So sources that are compiled and checked alike are
put one after the other into one file, and parsed with it once; #line says which is which, so that all of them count as the
main file, for which the compiler has warnings of its own. Where that finds anything, or names of two of them clash, the sources
that are named and the others are tried by themselves, down to single files, whose verdict counts. What is clean is an empty file
with the name of its key.

A source must not get from an earlier one an #include that it lacks. Of most the compiler sees that; of one that is compiled
with a precompiled header it does not see which of the files are missing that come with that header. So a source comes after
others only if they lack all of these files that it lacks (clang-scan-deps says which). Nor must an #include find another file
than it does by itself: sources whose folders of headers have a name in common are not put together. One thing is not seen so:
a class that is declared in a wrong namespace while a later source defines one of that name there.
"""

import functools
import json
import os
import re
import shlex
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

TOGETHER = 16
# Between two sources: a #define, since an #include may be repeated after one (readability-duplicate-include), and other names for
# the functions that each plugin has.
EVERY_PLUGINS = ("cairn_plugin_v1", "cairn_register")
BETWEEN = "".join(f"#undef {name}\n#define {name} {name}_{{}}\n" for name in EVERY_PLUGINS)


@dataclass
class Source:
    """A source of the compilation database."""

    file: str  # relative to the root
    key: str
    folder: str  # where it is compiled
    flags: list[str]
    precompiled: str  # the precompiled header, or nothing
    lacks: frozenset[str] = frozenset()  # the files that come with that header and not with the source


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


def find_precompiled(command: str) -> str:
    """The precompiled header in a compiler's command, or nothing."""
    return next((word for word in shlex.split(command) if word.endswith("cmake_pch.hxx")), "")


def as_others(flags: list[str]) -> tuple[str, ...]:
    """The flags that decide with which other sources one may be parsed: not those for the optimizer or the linker, nor where
    the headers of the project are."""
    return tuple(flag for flag in flags if not re.match(r"-f|-O|-I|-D\w+_EXPORTS$", flag))


def read_sources(database: Path, root: Path, keys: dict[str, str]) -> list[Source]:
    """Those of the database that have a key."""
    sources = {}
    for entry in json.loads(database.read_text()):
        file = os.path.relpath(os.path.join(entry["directory"], entry["file"]), root)
        if file in keys and file not in sources:
            command = entry["command"]
            sources[file] = Source(file, keys[file], entry["directory"], read_flags(command, entry["file"]), find_precompiled(command))
    return [sources[file] for file in sorted(sources)]


def reached(work: Path, sources: list[Source]) -> dict[str, set[str]]:
    """By key: all files that a source includes, also through others, without a precompiled header. What clang-scan-deps says
    nothing of (since it does not find a header, say) is left out."""
    database = work / "dependencies.json"
    database.write_text(json.dumps([{"directory": source.folder, "file": source.file, "output": source.key,
                                     "arguments": ["clang++", *source.flags, "-x", "c++", "-c", source.file, "-o", source.key]} for source in sources]))
    program = Path(shutil.which("clang-tidy") or "clang-tidy").resolve().parent / "clang-scan-deps"
    rules = subprocess.run([program, f"--compilation-database={database}"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False).stdout
    result = {}
    for rule in rules.replace("\\\n", " ").splitlines():
        target, _, files = rule.partition(":")
        result[target.strip()] = {os.path.realpath(file) for file in files.split()}
    return result


def is_public(file: str) -> bool:
    """Whether sources may include a header, rather than one that includes it."""
    return not re.search(r"/(bits|internal|src|detail|debug|ext|backward|pstl)/", file)


def find_lacking(root: Path, work: Path, sources: list[Source]) -> None:
    """Sets `lacks` of sources that are compiled with a precompiled header."""
    hidden = [replace(source, file=str(root / source.file)) for source in sources if source.precompiled]
    if not hidden:
        return
    headers = {source.precompiled: replace(source, file=source.precompiled, key=source.precompiled) for source in hidden}
    files = reached(work, [*hidden, *headers.values()])
    for source in sources:
        if source.precompiled:
            has, all_files = files.get(source.key, set()), files.get(source.precompiled, {source.file})
            source.lacks = frozenset(file for file in all_files if file not in has and is_public(file))


@functools.cache
def headers_in(folder: str) -> frozenset[str]:
    """What may be included from a folder."""
    return frozenset(os.path.relpath(path, folder) for path in Path(folder).rglob("*") if path.suffix in (".h", ".hpp"))


@functools.cache
def share_a_header(first: str, second: str) -> bool:
    """Whether an #include may mean a file in either of two folders."""
    return not headers_in(first).isdisjoint(headers_in(second))


def nearest_configuration(root: Path, file: str) -> str:
    """The .clang-tidy that holds for a file."""
    folder = (root / file).parent
    while folder != root and not (folder / ".clang-tidy").exists():
        folder = folder.parent
    return str(folder / ".clang-tidy")


def declared(text: str) -> frozenset[str]:
    """What a source seems to declare for itself: types and constants by their names, functions with the line that they begin on.
    Two sources that share something are better not parsed together."""
    found = re.findall(r"^(?:(?:class|struct|union|enum(?: class)?) (\w+)|(?!namespace |using |void cairn_register)[A-Za-z_][\w:<>,&*\[\] ]*?[ &*]"
                       r"(?:(\w+)(?:\[\w*\])?(?: =|\{|;)|(\w+\(.*)))", text, flags=re.MULTILINE)
    return frozenset("".join(match) for match in found)


class Group:
    """Sources that are parsed together."""

    def __init__(self) -> None:
        self.sources: list[Source] = []
        self.names: set[str] = set()
        self.folders: set[str] = set()  # of headers

    def takes(self, source: Source, names: frozenset[str]) -> bool:
        """Puts a source at the end, if it lacks no more than the last one, shares no name with any, and each of them finds the
        same headers as by itself."""
        if len(self.sources) == TOGETHER or self.sources and not source.lacks <= self.sources[-1].lacks or names & self.names:
            return False
        folders = {flag[2:] for flag in source.flags if flag.startswith("-I")}
        if self.sources and any(share_a_header(one, other) for one in self.folders - folders for other in folders - self.folders):
            return False
        self.folders |= folders
        self.sources.append(source)
        self.names |= names
        return True


def in_groups(root: Path, sources: list[Source]) -> list[list[Source]]:
    """Sources that are compiled and checked alike, at most TOGETHER in each, each after sources that lack what it lacks; the
    largest groups first."""
    alike: dict[tuple[object, ...], list[Group]] = {}
    for source in sorted(sources, key=lambda each: -len(each.lacks)):
        text = (root / source.file).read_text()
        names = declared(text)
        # What silences the compiler might do so for the next source, too.
        alone = source.file if re.search(r"# *pragma +(GCC|clang) +diagnostic", text) else ""
        groups = alike.setdefault((nearest_configuration(root, source.file), source.precompiled, as_others(source.flags), alone), [])
        if not any(group.takes(source, names) for group in groups):
            groups.append(Group())
            groups[-1].takes(source, names)
    return sorted((group.sources for groups in alike.values() for group in groups), key=len, reverse=True)


def flags_of(group: list[Source]) -> list[str]:
    """Those of the first, and where else the headers of the others are."""
    flags = list(group[0].flags)
    return flags + [flag for flag in dict.fromkeys(flag for source in group for flag in source.flags if flag.startswith("-I")) if flag not in flags]


def as_part(path: Path, number: int) -> str:
    """A source's text as a part of another file, elsewhere."""
    def found(include: re.Match[str]) -> str:
        beside = path.parent / include[2]
        return f'{include[1]}"{beside}"' if beside.is_file() else include[0]

    text = re.sub(r'^( *# *include *)"([^"]+)"', found, path.read_text(), flags=re.MULTILINE)
    return f'{BETWEEN.format(number, number)}#line 1 "{path}"\n{text}\n'


class Linter:
    """clang-tidy with the configuration of a checkout; `work`: a folder below its root for files of its own."""

    def __init__(self, root: Path, work: Path):
        self.root = root
        self.work = work

    def check(self, group: list[Source]) -> Result:
        """Together; where that is not clean, the sources that it names and the others, or each half if it names none or all."""
        if len(group) == 1:
            return self._check_one(group[0])
        unit = self.work / f"{group[0].key}.cpp"
        unit.write_text("".join(as_part(self.root / source.file, number) for number, source in enumerate(group)))
        output = self._tidy(unit, group, f"--config-file={nearest_configuration(self.root, group[0].file)}")
        unit.unlink()
        if output is None:
            return Result(group)
        named = [source for source in group if f"{self.root / source.file}:" in output]
        if not 0 < len(named) < len(group):
            named = group[len(group) // 2:]
        first, second = self.check([source for source in group if source not in named]), self.check(named)
        return Result(first.clean + second.clean, first.output + second.output)

    def _check_one(self, source: Source) -> Result:
        output = self._tidy(self.root / source.file, [source])
        return Result([source]) if output is None else Result(output=[output])

    def _tidy(self, file: Path, group: list[Source], *options: str) -> str | None:
        """What clang-tidy says of a file that is compiled as the group is; None: nothing."""
        done = subprocess.run(["clang-tidy", "--quiet", *options, str(file), "--", *flags_of(group)], cwd=group[0].folder,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if done.returncode == 0:
            return None
        return "\n".join(line for line in done.stdout.splitlines() if not re.fullmatch(r"\d+ warnings? generated\.", line))


def check_all(database: Path, clean: Path, keys: dict[str, str]) -> int:
    """The sources that have a key, of a compilation database of the checkout that is the working directory. Each that is clean
    gets its file in the folder `clean`; what is found is printed. Returns an exit code."""
    root = Path.cwd()
    work = database.parent / "units"
    work.mkdir(parents=True, exist_ok=True)
    linter = Linter(root, work.resolve())
    sources = read_sources(database, root, keys)
    find_lacking(root, work, sources)
    failed = False
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for result in pool.map(linter.check, in_groups(root, sources)):
            for source in result.clean:
                (clean / source.key).touch()
            for text in result.output:
                print(text, flush=True)
                failed = True
    return 1 if failed else 0
