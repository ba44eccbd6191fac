# SPDX-License-Identifier: BSD-3-Clause
"""The program that is measured."""
from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

from .data_sets import DataSet
from .processes import Outcome, run_program
from .reports import Json, items, text

Words = list[str]  # of a command line
TINY = DataSet("tiny", "@manhattan:poses=4")
USAGE, PLUGIN = 2, 5  # exit codes of what this build cannot do


class Failed(Exception):
    """A run gave no report; what `cairn` said."""


@dataclass
class Run:
    """One run of a command of `cairn` and what became of it."""

    outcome: Outcome
    report: Json  # None if there is none

    def required(self) -> Run:
        """Itself. Raises Failed with the program's complaint if it was in time and gave no report."""
        if self.report is None and self.outcome.in_time:
            raise Failed(self.outcome.complaint or "killed")
        return self


@dataclass
class Settings:
    """Of `cairn bench`: linear solvers go under `optimizer`; optimizers that bring their own stand in `complete`."""

    linear_solvers: Words = field(default_factory=list)
    complete: Words = field(default_factory=list)
    optimizer: str = "gauss_newton"


def parsed(output: str) -> Json:
    """The report on standard output; None if there is none."""
    try:
        return json.loads(output)
    except ValueError:
        return None


def with_start(words: Words) -> Words:
    """All start from the states that a file gives, where a data set names no start: that is what peers do."""
    return words if "--initial" in words else [*words, "--initial", "as_given"]


class Cairn:
    """Every run is a process of its own, so that its memory is known and nothing is warm that would not be for a user.

    Runs are stopped after `limit` seconds (0: never).
    """

    def __init__(self, program: str, work: Path):
        self.program = program
        self.work = work  # a folder for files of the runs
        work.mkdir(parents=True, exist_ok=True)

    def run(self, words: Words, limit: float = 0.0) -> Run:
        outcome = run_program([self.program, *words], self.work, limit)
        return Run(outcome, parsed(outcome.output))

    def native(self, name: str, words: Words) -> Run:
        """Of the programs of this folder, which lie beside `cairn`: what is measured within a process, or needs its library.
        Raises Failed if it gave no report."""
        outcome = run_program([str(Path(self.program).with_name(name)), *words], self.work)
        return Run(outcome, parsed(outcome.output)).required()

    def on(self, command: str, data: DataSet, arguments: Words, threads: int = 1, limit: float = 0.0) -> Run:
        """A command such as "replay" or "study compact" on a graph."""
        begin = [*command.split(), data.graph, "--json", "-", "--quiet", "--threads", str(threads)]
        return self.run([*begin, *data.arguments, *arguments], limit)

    def optimize(self, data: DataSet, arguments: Words, threads: int = 1, limit: float = 0.0) -> Run:
        words = with_start([*data.arguments, *arguments])
        return self.on("optimize", DataSet(data.name, data.graph), words, threads, limit)

    def bench(self, data: DataSet, settings: Settings, threads: int, rounds: int, more: Words) -> Json:
        """`cairn bench`: interleaved rounds on one graph; the whole report. Raises Failed if it gave none."""
        words = with_start(["--repeat", str(rounds), *data.arguments, *more])
        if settings.linear_solvers:
            words += ["--optimizer", settings.optimizer]
        for name in settings.complete:
            words += ["--optimizer", name]
        for name in settings.linear_solvers:
            words += ["--linear-solver", name]
        run = self.on("bench", DataSet(data.name, data.graph), words, threads)
        if not items(run.report, "graphs"):
            raise Failed(run.outcome.complaint)
        return run.report

    def names(self, kind: str) -> Words:
        """The names on offer of a kind, such as "linear_solver"."""
        offers = items(self.run(["plugins", "--json", "-", "--quiet"]).report, "offers")
        return [text(offer, "name") for offer in offers if text(offer, "kind") == kind]

    def accepted(self, option: str, specs: Words) -> Words:
        """Of the values of "--linear-solver" or "--optimizer", those that this build can make."""
        def code(spec: str) -> int:
            return self.optimize(TINY, [option, spec, "--iterations", "1"]).outcome.exit_code
        return [spec for spec in specs if code(spec) not in (USAGE, PLUGIN)]
