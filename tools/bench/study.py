# SPDX-License-Identifier: BSD-3-Clause
"""What every study is made of and is given."""
from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from .data_sets import DataSet
from .pages import Sections
from .program import Cairn, Failed
from .reports import Json


@dataclass
class Bench:
    """What every study is given."""

    cairn: Cairn
    data: Path | None = None  # folder of the real graphs
    quick: bool = False
    ours: str = "block_cholesky"  # cairn's own linear solver, with options
    rounds: int = 5
    peers: list[str] = field(default_factory=list)  # of the study minimum: NAME=COMMAND

    @property
    def rounds_of_runs(self) -> int:
        """Of runs that are no shorter when it is to be quick."""
        return 1 if self.quick else self.rounds


# Takes what was measured, one entry at a time, and keeps it at once: a study may take an hour.
Keep = Callable[[Json], None]


@dataclass
class Study:
    """`files` are what `./dev bench` draws: the content of each by its name."""

    name: str
    measure: Callable[[Bench, Keep], None]
    sections: Callable[[list[Json]], Sections]
    files: Callable[[list[Json]], dict[str, str]] = lambda entries: {}


def tell(sentence: str) -> None:
    """A line on standard error."""
    print(sentence, file=sys.stderr, flush=True)


def attempt(what: str, work: Callable[[], None]) -> None:
    """Calls `work`; what cannot be measured is named and left out."""
    try:
        tell(what)
        work()
    except (Failed, OSError, ValueError) as error:
        tell(f"{what} left out: {error}")
    except LookupError as error:  # of a report
        tell(f"{what} left out: no {error} in what cairn reports")


def for_each_set(study: str, sets: Iterable[DataSet], work: Callable[[DataSet], None]) -> None:
    for data in sets:
        attempt(f"{study}: {data.name}", lambda data=data: work(data))  # type: ignore[misc]
