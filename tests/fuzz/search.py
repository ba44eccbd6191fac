# SPDX-License-Identifier: BSD-3-Clause
"""The search of libFuzzer, behind `./dev fuzz`: one target after the other, each until its time is up or three inputs
are found.

    search.py [--check] [--fast] [MINUTES] [TARGET...]

In the root of a checkout whose build/fuzz or build/fuzz-fast is built; --check: only looks at the arguments. Everything
is kept in build/fuzz: corpus/TARGET, findings, logs, `run` (what this run was), and `totals` (executions and seconds of
each target; those without sanitizers in totals-fast).
"""
from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections import Counter
from dataclasses import astuple, dataclass
from pathlib import Path

TARGETS = ("reader", "packed_file", "line_protocol", "policy_protocol", "journal", "sidecar", "recording", "option_text",
           "incremental", "grid", "scan_log")
FOLDER = Path("build/fuzz")
REGRESSIONS = Path("tests/fuzz/regressions")
MINUTES = 10.0
ENOUGH = 3  # findings of a target in one run
MINIMIZING = 30  # [s]
# Without the stack of every allocation, which takes a third of the time; a finding that is repeated has them.
SANITIZERS = {"ASAN_OPTIONS": "malloc_context_size=1:quarantine_size_mb=8", "UBSAN_OPTIONS": "print_stacktrace=1"}


class Failed(Exception):
    """A program of a target did not even begin; what it said."""


@dataclass
class Arguments:
    """Of the command line."""

    check: bool
    fast: bool
    minutes: float
    targets: list[str]

    @property
    def preset(self) -> str:
        """The build whose programs are run."""
        return "fuzz-fast" if self.fast else "fuzz"

    @property
    def totals(self) -> Path:
        """The file with the executions of all runs."""
        return FOLDER / ("totals-fast" if self.fast else "totals")

    @property
    def seconds(self) -> int:
        """For each target."""
        return max(1, int(self.minutes * 60.0 / len(self.targets)))


def parse(words: list[str]) -> Arguments:
    """Raises ValueError if there is no such target."""
    words = list(words)
    check, fast = (bool(words[:1] == [option] and words.pop(0)) for option in ("--check", "--fast"))
    minutes = MINUTES
    if words and re.fullmatch(r"[0-9]+(\.[0-9]+)?", words[0]):
        minutes = float(words.pop(0))
    for name in words:
        if name not in TARGETS:
            raise ValueError(f"no target '{name}'; there are: {' '.join(TARGETS)}")
    return Arguments(check, fast, minutes, words or list(TARGETS))


@dataclass
class Result:
    """Of one target in one run."""

    name: str
    executions: int
    seconds: int
    coverage: int
    features: int
    corpus: int
    findings: int


def reached(log: str) -> tuple[int, int, int]:
    """Coverage, features and size of the corpus, by the last line of a log that has them."""
    last = next((line for line in reversed(log.split("\n")) if " cov: " in line), "")
    coverage, features, corpus = (re.search(rf".* {name}: ([0-9]+)", last) for name in ("cov", "ft", "corp"))
    return int(coverage[1]) if coverage else 0, int(features[1]) if features else 0, int(corpus[1]) if corpus else 0


def executions(log: str) -> int:
    """In all processes of a log."""
    return sum(int(count) for count in re.findall(r"^stat::number_of_executed_units: *([0-9]+)", log, re.MULTILINE))


def last_input(log: str) -> Path | None:
    """The file with the last input that failed; None if there is none."""
    written = re.findall(r"Test unit written to (.*)$", log, re.MULTILINE)
    return Path(written[-1]) if written and Path(written[-1]).is_file() else None


def minimize(program: str, found: Path) -> None:
    """Replaces an input with the smallest one found in half a minute that fails too; what is said of it goes into a
    log."""
    smaller, log = Path(f"{found}.smaller"), Path(f"{found}.log")
    with log.open("wb") as output:
        subprocess.run([program, "-minimize_crash=1", f"-max_total_time={MINIMIZING}", "-timeout=10", "-rss_limit_mb=2048",
                        "-print_funcs=0", f"-exact_artifact_path={smaller}", found],
                       stdout=output, stderr=subprocess.STDOUT, check=False)
    if smaller.is_file() and smaller.stat().st_size > 0:
        smaller.replace(found)
    smaller.unlink(missing_ok=True)
    with log.open("wb") as output:
        subprocess.run([program, "-print_funcs=0", found], stdout=output, stderr=subprocess.STDOUT, check=False,
                       env={**os.environ, "UBSAN_OPTIONS": SANITIZERS["UBSAN_OPTIONS"]})


def command(name: str, program: str, seconds: int) -> list[str]:
    """The command line of a target."""
    options = [(FOLDER / f"{name}.options").read_text().rstrip("\n")]
    words = FOLDER / f"{name}.dict"
    if words.is_file() and words.stat().st_size > 0:
        options.append(f"-dict={words}")
    corpora = [str(FOLDER / "corpus" / name)]
    if (REGRESSIONS / name).is_dir():
        corpora.append(str(REGRESSIONS / name))
    return [program, f"-max_total_time={seconds}", *options, f"-artifact_prefix={FOLDER}/findings/{name}-", "-timeout=10",
            "-report_slow_units=1", "-reload=0", "-rss_limit_mb=2048", "-print_funcs=0", "-print_final_stats=1", "-entropic=0",
            *corpora]


def search(name: str, seconds: int, program: str) -> Result:
    """One target. Raises Failed if its program ends before its first input."""
    log = FOLDER / "logs" / f"{name}.log"
    log.write_bytes(b"")
    left, spent, found = seconds, 0, 0
    while left > 0 and found < ENOUGH:
        began = int(time.monotonic())
        with log.open("ab") as output:
            ended = subprocess.run(command(name, program, left), stdout=output, stderr=subprocess.STDOUT,
                                   env={**os.environ, **SANITIZERS}, check=False)
        took = int(time.monotonic()) - began
        spent += took
        left -= max(took, 1)
        if ended.returncode == 0:
            break
        said = log.read_text(encoding="utf-8", errors="replace")
        failing = last_input(said)
        if failing is None:
            raise Failed("\n".join([f"{program} ends before its first input:", *said.splitlines()[-40:]]))
        found += 1
        minimize(program, failing)
    slow = f"findings/{name}-slow-unit-*"
    if any(FOLDER.glob(slow)):
        print(f"{name}: inputs that took longer than a second: {FOLDER}/{slow}", file=sys.stderr)
    said = log.read_text(encoding="utf-8", errors="replace")
    return Result(name, executions(said), spent, *reached(said), found)


def keep(result: Result, totals: Path) -> None:
    """Adds a line to the file of this run, and one to that of all runs."""
    with (FOLDER / "run").open("a") as this_run:
        print(*astuple(result), file=this_run)
    with totals.open("a") as all_runs:
        print(result.name, result.executions, result.seconds, result.findings, file=all_runs)


def table(results: list[Result], totals: str) -> str:
    """Of this run, and of all by the file of totals."""
    total: Counter[str] = Counter()
    seconds: Counter[str] = Counter()
    for line in totals.splitlines():
        name, count, took, *_ = line.split()
        total[name] += int(count)
        seconds[name] += int(took)
    lines = [f"{'target':<16} {'executions':>12} {'per s':>9} {'coverage':>9} {'features':>9} {'corpus':>7} {'findings':>9} "
             f"{'in all':>14} {'hours':>8}"]
    for one in results:
        lines.append(f"{one.name:<16} {one.executions:12d} {one.executions / max(one.seconds, 1):9.0f} {one.coverage:9d} "
                     f"{one.features:9d} {one.corpus:7d} {one.findings:9d} {total[one.name]:14d} {seconds[one.name] / 3600:8.2f}")
    return "\n".join(lines)


def findings() -> list[str]:
    """The inputs of this and earlier runs with their sizes, the smallest first."""
    files = [file for file in (FOLDER / "findings").rglob("*") if file.is_file() and file.suffix != ".log"]
    return [f"{size} {file}" for size, file in sorted((file.stat().st_size, str(file)) for file in files)]


def run(given: Arguments) -> int:
    """The exit code: 1 if anything was found."""
    for folder in ("findings", "logs"):
        (FOLDER / folder).mkdir(parents=True, exist_ok=True)
    programs = f"build/{given.preset}/bin"
    seeds = subprocess.run([f"{programs}/fuzz_seeds", FOLDER], check=False).returncode
    if seeds != 0:
        return seeds if seeds > 0 else 128 - seeds
    (FOLDER / "run").write_text("")
    results = []
    for name in given.targets:
        print(f"{name}: {given.seconds} s", file=sys.stderr, flush=True)
        results.append(search(name, given.seconds, f"{programs}/fuzz_{name}"))
        keep(results[-1], given.totals)
    print(f"\n{table(results, given.totals.read_text())}", flush=True)
    if not any(result.findings for result in results):
        return 0
    print(f"\nfindings, smallest inputs first; {programs}/fuzz_TARGET FILE repeats one:\n", file=sys.stderr)
    print("\n".join(findings()), file=sys.stderr)
    return 1


def main(words: list[str]) -> int:
    """The exit code."""
    try:
        given = parse(words)
    except ValueError as error:
        print(f"./dev fuzz: {error}", file=sys.stderr)
        return 2
    try:
        return 0 if given.check else run(given)
    except Failed as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
