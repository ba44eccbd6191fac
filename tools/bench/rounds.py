# SPDX-License-Identifier: BSD-3-Clause
"""Interleaved runs: a machine that slows down for a while slows all that are compared."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from .program import Run, Words
from .reports import Json


@dataclass
class Contestant:
    """One of those that are compared on a graph, and how it went."""

    name: str
    arguments: Words = field(default_factory=list)
    limit: float = 0.0  # a run is given up after so many seconds; 0: never
    enough: float = 20.0  # no more runs that would take longer than so many seconds together
    runs: list[Json] = field(default_factory=list)
    spent: float = 0.0  # [s]
    in_time: bool = True

    def runs_again(self) -> bool:
        if not self.runs:
            return self.in_time
        return self.in_time and self.spent * (1.0 + 1.0 / len(self.runs)) <= self.enough

    def take(self, run: Run, summarize: Callable[[Json], Json]) -> None:
        self.in_time = run.outcome.in_time
        if self.in_time:
            self.runs.append(summarize(run.report))
            self.spent += run.outcome.seconds

    def entry(self) -> Json:
        return {"name": self.name, "in_time": self.in_time, "limit": self.limit, "runs": self.runs}


def run_rounds(rounds: int, contestants: list[Contestant], run: Callable[[Contestant], Run],
               summarize: Callable[[Json], Json]) -> None:
    """Each in turn, each round beginning with another one. Of every report the summary is kept."""
    for number in range(rounds):
        for k in range(len(contestants)):
            one = contestants[(k + number) % len(contestants)]
            if len(one.runs) >= number and one.runs_again():
                one.take(run(one), summarize)


def entries_of(contestants: list[Contestant]) -> list[Json]:
    return [one.entry() for one in contestants]
