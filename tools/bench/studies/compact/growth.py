# SPDX-License-Identifier: BSD-3-Clause
"""A robot that drives the same lap again and again: time and size against the number of laps."""
from __future__ import annotations

import json
import math
from dataclasses import replace

import pandas as pd

from ...averages import fitted_exponent, median, percentile
from ...data_sets import ELLIPSE_N_SENSOR, DataSet, ellipse_n
from ...pages import Sections, table
from ...reports import NONE, Json, contestant, items, median_of, member, number, parts, text
from ...rounds import Contestant, entries_of, run_rounds
from ...study import Bench, Keep, Study, tell
from ...words import count, digits, milliseconds, total, whole
from .runs import TITLES, contestants_with, find_both_thresholds, named_once, run_compact, summary

# A strategy that takes longer is not tried on more laps.
LIMIT, ENOUGH = 120.0, 10.0  # [s]
# With which the map of a place stops growing.
RELOCATING = ["--policy", "compact_pose:reuse=true"]
LAPS, LAPS_QUICK = [1, 2, 3, 5, 8, 10, 12, 15, 20, 25, 30], [1, 2, 3]


def lap_set(laps: int, more: str = "") -> DataSet:
    return replace(ellipse_n(laps, more), name=f"ellipse_n, {laps} lap{'' if laps == 1 else 's'}")


def measure_growth(bench: Bench, contestants: list[Contestant], keep: Keep) -> None:
    left = contestants
    for laps in LAPS_QUICK if bench.quick else LAPS:
        data = lap_set(laps)
        tell(f"compact, growth: {data.name}")
        running = [replace(one, runs=[]) for one in left]
        run_rounds(bench.rounds_of_runs, running, lambda c, data=data:  # type: ignore[misc]
                   run_compact(bench, data, c.arguments, c.limit), summary)
        keep({"part": "growth", "laps": laps, "contestants": entries_of(running)})
        left = [one for one, ran in zip(left, running) if ran.in_time]


def times_of_quarter(seconds: pd.Series, quarter: int) -> Json:
    """The fourth part of the steps that begins at `quarter` / 4 of them."""
    some = seconds[quarter * len(seconds) // 4:(quarter + 1) * len(seconds) // 4]
    return {"median": median(some), "p99": percentile(some, 0.99)}


def measure_laps(bench: Bench, one: Contestant) -> Json:
    """A sensor that matches whatever is near, as long as the robot drives."""
    laps = 20 if bench.quick else 200
    data = lap_set(laps, ",loop_density=0")
    tell(f"compact, growth: {data.name}, simulated matches, {one.name}")
    file = str(bench.cairn.work / "steps.csv")
    run = run_compact(bench, data, [*one.arguments, "--registration", f"simulated:{ELLIPSE_N_SENSOR}", "--steps", file], one.limit)
    entry = {"part": "laps", "name": one.name, "laps": laps, "in_time": run.outcome.in_time, "limit": one.limit}
    if not run.outcome.in_time:
        return entry
    steps = pd.read_csv(file)
    after = []
    for part in [20, 4, 2, 1]:  # of 200 laps: 10, 50, 100, 200
        last = steps.iloc[len(steps) // part - 1]
        after.append({"laps": laps // part, "poses": float(last["poses"]), "loops": float(last["loops"])})
    return {**entry, "after": after, "first_quarter": times_of_quarter(steps["seconds"], 0),
            "last_quarter": times_of_quarter(steps["seconds"], 3), "run": summary(run.report)}


def study_growth(bench: Bench, keep: Keep) -> None:
    thresholds = find_both_thresholds(bench, lap_set(3 if bench.quick else 10), RELOCATING)
    keep({"part": "thresholds", **{of: one.found for of, one in thresholds.items()}})
    contestants = contestants_with(thresholds, LIMIT, ENOUGH, RELOCATING)
    measure_growth(bench, contestants, keep)
    for one in contestants:
        if one.name != "tested":
            keep(measure_laps(bench, one))


# Tables

STRATEGIES = ["tested", "fpfl", "by_rule"]


def growth_table(entries: list[Json]) -> str:
    rows = []
    for entry in parts(entries, "growth"):
        # Whoever was in time: they are fed with the same.
        ran = [c for c in items(entry, "contestants") if items(c, "runs")]
        row = [whole(number(entry, "laps")),
               *(whole(median_of(ran[-1], of) if ran else NONE) for of in ["poses.in", "loops.in"]),
               total(contestant(entry, "tested"))]
        for c in [contestant(entry, "fpfl"), contestant(entry, "by_rule")]:
            row += [total(c), whole(median_of(c, "poses.kept")), whole(median_of(c, "loops.kept"))]
        rows.append(row)
    return table(["laps", "poses", "loops", "APAL [s]", "FPFL [s]", "FPFL: poses kept", "FPFL: loops kept",
                  "FPFL as published [s]", "FPFL as published: poses kept", "FPFL as published: loops kept"], rows)


def nonzeros_table(entries: list[Json]) -> str:
    rows = [[whole(number(entry, "laps")), *(count(median_of(contestant(entry, name), f"nonzeros.{of}"))
                                             for name in STRATEGIES for of in ["information", "factor"])]
            for entry in parts(entries, "growth")]
    return table(["laps", *(f"{of}, {TITLES[name]}" for name in STRATEGIES for of in "HL")], rows)


def laws(entries: list[Json]) -> str:
    """By the runs of some laps: the first few are another matter."""
    fewest_laps = 5
    sentences = []
    for name in STRATEGIES:
        ran = [(number(entry, "laps"), contestant(entry, name)) for entry in parts(entries, "growth")
               if number(entry, "laps") >= fewest_laps]
        ran = [(laps, c) for laps, c in ran if math.isfinite(median_of(c, "seconds.total"))]
        if len(ran) > 1:
            time, nonzeros = (fitted_exponent([laps for laps, _ in ran], [median_of(c, of) for _, c in ran])
                              for of in ["seconds.total", "nonzeros.factor"])
            sentences.append(f"{TITLES[name]}: time as N^{time:.2f}, nonzeros of L as N^{nonzeros:.2f}")
    return f"\nFrom five laps on, {'; '.join(sentences)}.\n" if sentences else ""


def laps_table(entries: list[Json]) -> str:
    rows, steps = [], []
    for entry in parts(entries, "laps"):
        title = TITLES.get(text(entry, "name"), text(entry, "name"))
        if member(entry, "in_time") is not True:
            rows.append([title, whole(number(entry, "laps")), f"not finished after {number(entry, 'limit'):.0f} s", "-"])
            continue
        steps.append([title, digits(number(entry, "run.seconds.total")),
                      *(milliseconds(number(entry, f"{quarter}_quarter.{of}"))
                        for quarter in ["first", "last"] for of in ["median", "p99"])])
        rows += named_once([[whole(number(after, of)) for of in ["laps", "poses", "loops"]] for after in items(entry, "after")],
                           title)
    return (table(["strategy", "laps", "poses kept", "loops kept"], rows) + "\n"
            + table(["strategy", "all [s]", "median step, first quarter [ms]", "99 %, first quarter [ms]", "median step, last quarter [ms]",
                     "99 %, last quarter [ms]"], steps))


def sections(entries: list[Json]) -> Sections:
    return {"compact-growth": growth_table(entries) + "\n" + nonzeros_table(entries) + laws(entries),
            "compact-laps": laps_table(entries)}


def picture(entries: list[Json]) -> dict[str, str]:
    """The growth with the number of poses, a line a strategy."""
    graphs = []
    for entry in parts(entries, "growth"):
        for name in STRATEGIES:
            c = contestant(entry, name)
            seconds = median_of(c, "seconds.total")
            if math.isfinite(seconds):
                graphs.append({"graph": {"file": TITLES[name], "variables": median_of(c, "poses.in")}, "configurations": [
                    {"optimizer": TITLES[name], "seconds": {"median": seconds},
                     "peak_memory_bytes": median_of(c, "peak_memory_bytes")}]})
    return {"compact_growth_picture.json": json.dumps({"command": "bench", "graphs": graphs}) + "\n"}


STUDIES = [Study("compact_growth", study_growth, sections, picture)]
