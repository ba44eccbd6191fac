# SPDX-License-Identifier: BSD-3-Clause
"""What explorers cover on every floor as it is, turned and mirrored, with every kind of motion; and the default explorer on one
floor until nearly all is seen."""
from __future__ import annotations

import random
from dataclasses import dataclass

from ...averages import median, percentile
from ...pages import Sections, table
from ...reports import Json, items, number, text
from ...study import Bench, Keep, Study
from ...words import digits, percent, plain, whole
from .floor_views import VIEWS, viewed
from .runs import FLOORS, end_of, floor_of, is_done, measure, measured, problem_of, runs_of

DEFAULT = "drrt_star"
MOTIONS = ["differential", "holonomic", "dubins"]
SEEDS = 2
WAREHOUSE_SEEDS = 20
# What "finished" promises, and an error that a note has to announce [m].
NEARLY_ALL, LARGE_ERROR = 0.95, 0.5


@dataclass(frozen=True)
class Setting:
    floor: str
    view: str
    motion: str


SETTINGS = [Setting(floor, view, motion) for floor in FLOORS for view in VIEWS for motion in MOTIONS]


def third_of(explorer: str) -> list[Setting]:
    """Drawn at random, the same each time; the report has the list."""
    return sorted(random.Random(explorer).sample(SETTINGS, len(SETTINGS) // 3), key=SETTINGS.index)


def cover(bench: Bench, part: str, explorer: str, setting: Setting) -> Json:
    floor = viewed(bench, floor_of(bench, setting.floor, "@rooms"), setting.view)
    until = ["--until", "distance=10" if bench.quick else "distance=150"]
    entry = measure(bench, part, floor, explorer or "default", explorer, SEEDS,
                    ["--world", f"lidar_building:motion={setting.motion}", *until])
    return {**entry, "floor": setting.floor, "view": setting.view, "motion": setting.motion}


def study_default(bench: Bench, keep: Keep) -> None:
    for setting in SETTINGS[:2] if bench.quick else SETTINGS:
        keep(cover(bench, "default", "", setting))


def study_others(bench: Bench, keep: Keep) -> None:
    for explorer in bench.cairn.names("explorer"):
        if explorer != DEFAULT:
            for setting in third_of(explorer)[:1 if bench.quick else None]:
                keep(cover(bench, "others", explorer, setting))


def study_warehouse(bench: Bench, keep: Keep) -> None:
    floor = floor_of(bench, "warehouse", "@loop")
    runs = 2 if bench.quick else WAREHOUSE_SEEDS
    keep(measure(bench, "warehouse", floor, "default", "", runs, ["--until", "distance=10" if bench.quick else "known=0.99"]))


# Tables


def all_runs(entries: list[Json]) -> list[Json]:
    return [run for entry in entries for run in runs_of(entry)]


def shares(runs: list[Json]) -> str:
    """Of what the body can cover, what was seen: mean, and the least."""
    seen = [measured(run, "reachable_seen") for run in runs if is_done(run)]
    return f"{percent(sum(seen) / len(seen))} ({percent(min(seen))})" if seen else "-"


def ends(entries: list[Json]) -> list[str]:
    """Counts: finished; of these, with less than 95 %; at the limit; stuck; failed, with settings that did not run."""
    runs = all_runs(entries)
    finished = [run for run in runs if end_of(run) == "finished"]
    counts = [len(finished), sum(measured(run, "reachable_seen") < NEARLY_ALL for run in finished),
              *(sum(end_of(run) == end for run in runs) for end in ["limit", "stuck"]),
              sum(not is_done(run) for run in runs) + SEEDS * sum(problem_of(entry) != "" for entry in entries)]
    return [str(count) for count in counts]


def errors(runs: list[Json]) -> list[str]:
    """ATE: median, largest; how many are large; how many of these without any note."""
    ates = {id(run): measured(run, "ate") for run in runs if is_done(run)}
    large = [run for run in runs if ates.get(id(run), 0.0) > LARGE_ERROR]
    known = [ate for ate in ates.values() if ate == ate]
    return [digits(median(known)), digits(max(known, default=0.0)), str(len(large)), str(sum(not items(run, "notes") for run in large))]


END_COLUMNS = ["finished", "of them below 95 %", "limit", "stuck", "failed"]
ERROR_COLUMNS = ["ATE [m]: median", "largest", "above 0.5 m", "without a note"]


def rows_by(entries: list[Json], key: str, keys: list[str]) -> str:
    rows = []
    for value in [*keys, "all"]:
        some = [entry for entry in entries if value in ("all", text(entry, key))]
        runs = all_runs(some)
        by_motion = [shares(all_runs([entry for entry in some if text(entry, "motion") == motion])) for motion in MOTIONS]
        rows.append([value, str(len(runs)), *by_motion, *ends(some), whole(sum(measured(run, "collisions") for run in runs if is_done(run))),
                     *errors(runs), digits(percentile([measured(run, "decision_p95") for run in runs if is_done(run)], 0.95))])
    return table([key, "runs", *(f"seen, {motion}" for motion in MOTIONS), *END_COLUMNS, "collisions", *ERROR_COLUMNS, "95 % of decisions [s]"],
                 rows)


def default_sections(entries: list[Json]) -> Sections:
    return {"explore-default": rows_by(entries, "floor", list(dict.fromkeys(text(entry, "floor") for entry in entries)))}


def others_sections(entries: list[Json]) -> Sections:
    return {"explore-others": rows_by(entries, "method", list(dict.fromkeys(text(entry, "method") for entry in entries)))}


def warehouse_sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        if problem_of(entry):
            rows.append([problem_of(entry), *[""] * 7])
        for run in runs_of(entry):
            of = {measure: measured(run, measure) for measure in ["reachable_seen", "distance", "ate", "expected_ate", "wrong", "loops"]}
            rows.append([f"{number(run, 'seed'):.0f}", end_of(run), percent(of["reachable_seen"], 1), digits(of["distance"]),
                         digits(of["ate"]), digits(of["expected_ate"]), digits(of["wrong"]), whole(of["loops"]),
                         plain(len(items(run, "notes")))])
    return {"explore-warehouse": table(["seed", "end", "seen", "driven [m]", "ATE [m]", "expected [m]", "wrong [m²]", "loops", "notes"], rows)}


STUDIES = [Study("explore_default", study_default, default_sections),
           Study("explore_others", study_others, others_sections),
           Study("explore_warehouse", study_warehouse, warehouse_sections)]
