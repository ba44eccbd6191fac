# SPDX-License-Identifier: BSD-3-Clause
"""What the studies of `cairn explore` share: a method on a floor, and what its runs say."""
from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

from ...data_sets import DataSet
from ...intervals import MeanInterval, mean_interval, paired_difference, value_at
from ...program import Words
from ...reports import NONE, Json, items, member, number, text
from ...study import Bench, tell


FLOORS = ["cave_20m", "fr079", "intel_lab", "hospital_40m", "willow_full", "stata_basement", "depot", "warehouse",
          "simple_rooms", "tb3_sandbox"]


def all_floors(bench: Bench) -> list[DataSet]:
    floors = [floor for floor in (floor_of(bench, name, "") for name in FLOORS) if floor.graph]
    floors = floors or [DataSet(kind, kind) for kind in ["@rooms", "@corridor", "@loop", "@cave"]]
    return floors[:2] if bench.quick else floors


def floor_of(bench: Bench, name: str, generated: str) -> DataSet:
    """The floor of the data, or what is generated in its place."""
    file = (bench.data or Path()) / "maps" / f"{name}.yaml"
    return DataSet(name, str(file)) if bench.data and file.exists() else DataSet(generated, generated)


def measure(bench: Bench, part: str, floor: DataSet, method: str, explorer: str, runs: int, settings: Words) -> Json:
    """One method on one floor, with some seeds; explorer "": the default. Explorers without a plugin in this build are kept as
    missing."""
    entry: Json = {"part": part, "name": floor.name, "method": method, "explorer": explorer}
    if explorer and explorer.partition(":")[0] not in bench.cairn.names("explorer"):
        tell(f"explore, {part}: {explorer} is not in this build: left out")
        return {**entry, "missing": True}
    tell(f"explore, {part}: {method} on {floor.name}, {runs} runs")
    curves = str(bench.cairn.work / f"explore_{part}_{method}.csv")
    limit = 120.0 if bench.quick else 3600.0  # so that the whole takes an hour [s]
    run = bench.cairn.on("explore", floor, [*(["--explorer", explorer] if explorer else []), "--runs", str(runs), "--curves", curves, *settings],
                         min(os.cpu_count() or 1, 2), limit)
    entry["in_time"] = run.outcome.in_time
    if run.report is None:
        return {**entry, "error": run.outcome.complaint if run.outcome.in_time else "took too long"}
    return {**entry, "report": {name: value for name, value in run.report.items() if name != "curves"}}


# What the runs of a method, an entry, say

ENDS = ["finished", "limit", "stuck"]  # of runs that are done
MAP_ERROR_AT_COVERAGE, WRONG_AT_SEEN = "map_error at equal coverage", "wrong at equal part seen"


def runs_of(method: Json) -> list[Json]:
    return items(method, "report.runs")


def problem_of(method: Json) -> str:
    """Why it has no runs, or nothing."""
    return "not in this build" if member(method, "missing") else text(method, "error")


def is_done(run: Json) -> bool:
    return text(run, "end") in ENDS


def end_of(run: Json) -> str:
    return text(run, "end") if is_done(run) else "failed"


def ends_of(method: Json) -> str:
    """"4 limit, 1 stuck"."""
    counts = Counter(end_of(run) for run in runs_of(method))
    return ", ".join(f"{count} {end}" for end, count in sorted(counts.items())) or problem_of(method)


def measured(run: Json, measure: str) -> float:
    """By its name in the reports; times have a group of their own."""
    values = {**(member(run, "measures") or {}), **(member(run, "measured_seconds") or {})}
    return number(values, measure) if is_done(run) else NONE


def mean_of(method: Json, measure: str) -> MeanInterval:
    return mean_interval([measured(run, measure) for run in runs_of(method)])


def map_curve(run: Json, what: str) -> tuple[list[float], list[float]]:
    """Coverage and error of the map while it grew: what the robot itself can know (thesis, 5.14), or beside the truth."""
    def samples(of: str) -> list[float]:
        return [NONE if value is None else float(value) for value in items(run, f"samples.{of}")]
    if what == MAP_ERROR_AT_COVERAGE:
        return samples("coverage"), samples("map_error")
    return samples("seen"), [a + b for a, b in zip(samples("free_wrong"), samples("occupied_wrong"))]


def difference_of(method: Json, reference: Json, measure: str, factor: float = 1.0) -> MeanInterval:
    """Of method − factor · reference, seed by seed; of maps at the largest coverage that both reach."""
    others = {number(run, "seed"): run for run in reversed(runs_of(reference)) if is_done(run)}
    values, references = [], []
    for run in runs_of(method):
        other = others.get(number(run, "seed"))
        if not is_done(run) or other is None:
            continue
        if measure in (MAP_ERROR_AT_COVERAGE, WRONG_AT_SEEN):
            curves = [map_curve(one, measure) for one in [run, other]]
            place = min(max((x for x in curve[0] if x == x), default=NONE) for curve in curves)
            values.append(value_at(*curves[0], place))
            references.append(value_at(*curves[1], place))
        else:
            values.append(measured(run, measure))
            references.append(factor * measured(other, measure))
    return paired_difference(values, references)
