# SPDX-License-Identifier: BSD-3-Clause
"""What tables ask of JSON: members by a path such as "graph.variables", and medians over the runs of a contestant.

What is not there is NaN, an empty text or an empty list, so that a table has "-" where nothing was measured.
"""
from __future__ import annotations

import math
from typing import Any

from .averages import median, ratio

Json = Any  # what json.loads returns
NONE = math.nan


def member(value: Json, path: str) -> Json:
    """The member at a path; None where there is none."""
    for name in path.split("."):
        value = value.get(name) if isinstance(value, dict) else None
    return value


def number(value: Json, path: str) -> float:
    found = member(value, path)
    return float(found) if isinstance(found, (int, float)) and not isinstance(found, bool) else NONE


def text(value: Json, path: str) -> str:
    found = member(value, path)
    return found if isinstance(found, str) else ""


def items(value: Json, path: str) -> list[Json]:
    found = member(value, path)
    return found if isinstance(found, list) else []


def parts(entries: list[Json], part: str) -> list[Json]:
    """The entries of one part of a study."""
    return [entry for entry in entries if text(entry, "part") == part]


# Contestants: an entry has {"contestants": [{"name", "in_time", "limit", "runs": [...]}, ...]}


def contestant(entry: Json, name: str) -> Json:
    """None if there is no such contestant."""
    return next((c for c in items(entry, "contestants") if text(c, "name") == name), None)


def median_of(contestant: Json, path: str) -> float:
    """The median over the runs that have a number there."""
    values = [number(run, path) for run in items(contestant, "runs")]
    return median([value for value in values if math.isfinite(value)])


def paired_ratio(peer: Json, mine: Json) -> float:
    """The median of the ratios of total times within the rounds that both were in."""
    pairs = zip(items(peer, "runs"), items(mine, "runs"))
    return median([ratio(number(a, "seconds.total"), number(b, "seconds.total")) for a, b in pairs])


def was_late(contestant: Json) -> bool:
    """Whether one run took too long."""
    return member(contestant, "in_time") is False


def why_none(entry: Json, limit: float) -> str:
    """Of a run without a report: "> 600 s", or "refused (code 3)"."""
    return f"> {limit:.0f} s" if member(entry, "in_time") is False else f"refused (code {number(entry, 'code'):.0f})"
