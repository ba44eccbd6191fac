# SPDX-License-Identifier: BSD-3-Clause
"""What the studies of `cairn compact` share."""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...averages import ratio
from ...data_sets import DataSet
from ...program import Failed, Run, Words
from ...reports import Json, median_of, text
from ...rounds import Contestant
from ...study import Bench
from ...words import percent, times

AS_PUBLISHED = "compact_pose:wide=false,noise_scale=1"  # Algorithm 1 of the paper, with candidates by equation 18 alone
# Policy of APAL: no pair of poses is tested for being near (s = 0), so that every loop closure of a recording is found.
ALL_LOOPS = "compact_pose:search=recorded"


def planar_truth(kitti: str) -> str:
    """KITTI's poses of a camera, rows of [R t] with x to the right, y down and z forward, as the planar poses of a robot on
    the ground: lines `VERTEX_SE2 row x y theta`, x forward and y to the left."""
    numbers = np.array(kitti.split(), dtype=float)
    rows = numbers[:len(numbers) // 12 * 12].reshape(-1, 12)
    # R's third column is where the camera looks.
    return "".join(f"VERTEX_SE2 {k} {float(row[11])!r} {float(-row[3])!r} {math.atan2(-row[2], row[10])!r}\n"
                   for k, row in enumerate(rows))


def with_truth(bench: Bench, data: DataSet) -> DataSet:
    """The graph, with the truth among its arguments, which may have to be made first."""
    work = bench.cairn.work
    made = work / f"{data.name}_truth.g2o"
    file: str | Path = made
    if data.truth == "generated":
        return data
    if data.truth == "file":
        file = data.truth_file
    elif data.truth == "camera":
        made.write_text(planar_truth(Path(data.truth_file).read_text(encoding="utf-8")), encoding="utf-8")
    elif data.truth == "simulated":
        data = replace(data, graph=str(work / f"{data.name}.g2o"))
        bench.cairn.native("cairn_camera_world", [data.truth_file, str(made), data.graph])
    else:
        source = replace(data, graph=data.truth_file) if data.truth == "edges" else data
        run = bench.cairn.optimize(source, [*data.truth_arguments, "-o", str(made)])
        if text(run.report, "status") != "converged":
            raise Failed(f"no truth: {run.outcome.complaint}")
    return replace(data, arguments=[*data.arguments, "--truth", str(file)])


def run_compact(bench: Bench, data: DataSet, arguments: Words, limit: float = 0.0) -> Run:
    """One run with one thread."""
    return bench.cairn.on("study compact", data, arguments, 1, limit).required()


def summary(report: Json) -> Json:
    """What the tables want of a run."""
    names = ["poses", "loops", "verdicts", "seconds", "steps", "nonzeros", "errors", "nees", "peak_memory_bytes"]
    return {**{name: report[name] for name in names}, "chi2": report["chi2"]["final"]}


@dataclass
class Thresholds:
    """Thresholds that a sample of a graph gave."""

    file: str
    found: Json  # what the report says of them


def find_thresholds(bench: Bench, data: DataSet, name: str, more: Words | None = None) -> Thresholds:
    """By default, or with more arguments; `name` is that of the file."""
    file = str(bench.cairn.work / f"{name}_thresholds.json")
    report = run_compact(bench, data, ["--auto", "--save-thresholds", file, *(more or [])]).report
    return Thresholds(file, report["thresholds"])


BY_RULE = ["--error-ratio", "0", "--policy", AS_PUBLISHED]  # of section 5.2 alone


def find_both_thresholds(bench: Bench, data: DataSet, policy: Words | None = None) -> dict[str, Thresholds]:
    """As found by default, perhaps with a policy; and as published: by the rule of section 5.2 alone."""
    return {"found": find_thresholds(bench, data, "found", policy), "by_rule": find_thresholds(bench, data, "by_rule", BY_RULE)}


def contestants_with(thresholds: dict[str, Thresholds], limit: float, enough: float,
                     policy: Words | None = None) -> list[Contestant]:
    """All poses, and all loops that the distance test finds ("tested"), then few of both with each of these thresholds."""
    def one(name: str, strategy: str, of: str, more: Words) -> Contestant:
        return Contestant(name, ["--strategy", strategy, "--thresholds", thresholds[of].file, *more], limit, enough)
    return [one("tested", "apal", "found", []), one("fpfl", "fpfl", "found", policy or []),
            one("by_rule", "fpfl", "by_rule", ["--policy", AS_PUBLISHED])]


def run_seeds(bench: Bench, data: DataSet, contestant: Contestant, seeds: int,
              seeded: Callable[[int], Words] = lambda seed: []) -> Contestant:
    """The same with another seed each time, from 1 on, until one is late. `seeded` says which arguments that means."""
    for seed in range(1, seeds + 1):
        if contestant.in_time:
            contestant.take(run_compact(bench, data, [*contestant.arguments, *seeded(seed)], contestant.limit), summary)
    return contestant


# Tables

ERRORS = ["ate.translation", "ate.rotation", "rpe.translation", "rpe.rotation", "rpe_all.translation", "rpe_all.rotation"]
EXACT = 1e-4  # [m]
TITLES = {"tested": "APAL", "apal": "APAL", "fpfl": "FPFL", "by_rule": "FPFL as published"}


def tenths(part: float) -> str:
    """"2.9 %" of 0.029."""
    return percent(part, 1)


def part_kept(kept: float, of: float) -> str:
    return tenths(ratio(kept, of))


def error_of(contestant: Json, error: str, recovery: str = "v2") -> float:
    return median_of(contestant, f"errors.{recovery}.{error}")


def ate(contestant: Json) -> float:
    return error_of(contestant, ERRORS[0])


def over(error: float, reference: float) -> str:
    """Where the truth is what APAL converges to, a ratio to its error has no meaning."""
    if not math.isfinite(error) or not math.isfinite(reference):
        return ""
    return "-" if reference < EXACT else times(error / reference)


def with_dagger(entry: Json) -> str:
    """The name of the graph, marked where nobody knows the truth."""
    return text(entry, "name") + (" †" if entry.get("de_facto") else "")


def named_once(rows: list[list[str]], name: str) -> list[list[str]]:
    """The rows with the name before the first of them."""
    return [[name if k == 0 else "", *row] for k, row in enumerate(rows)]
