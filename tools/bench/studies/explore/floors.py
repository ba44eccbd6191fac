# SPDX-License-Identifier: BSD-3-Clause
"""Every explorer on every floor; and what the thesis is silent about, changed one by one."""
from __future__ import annotations

from ...data_sets import DataSet
from ...pages import Sections, table
from ...program import Words
from ...reports import Json, number, text
from ...study import Bench, Keep, Study
from ...words import digits, percent, whole
from .runs import end_of, floor_of, mean_of, measure, measured, problem_of, runs_of
from .thesis import ALPHA_AT_END, action_space

FLOORS = ["cave_20m", "fr079", "intel_lab", "hospital_40m", "willow_full", "stata_basement", "depot", "warehouse",
          "simple_rooms", "tb3_sandbox"]
SIX = ["cave_20m", "fr079", "intel_lab", "depot", "simple_rooms", "tb3_sandbox"]
# Of each method on a floor so many runs have a line of their own; the means are of all.
LISTED = 2
MEANS = {"seen": "of the floor seen [m²]", "wrong": "wrong cells [m²]", "ate": "ATE [m]", "trajectory_entropy": "trajectory entropy [nats]"}
SIX_MEANS = {**MEANS, "map_entropy": "map entropy [nats·m²]", "loops": "loop closures", "seconds": "time of a run [s]"}


def all_floors(bench: Bench) -> list[DataSet]:
    floors = [floor for floor in (floor_of(bench, name, "") for name in FLOORS) if floor.graph]
    floors = floors or [DataSet(kind, kind) for kind in ["@rooms", "@corridors", "@loop", "@cave"]]
    return floors[:2] if bench.quick else floors


def study_floors(bench: Bench, keep: Keep) -> None:
    until = ["--until", "distance=10" if bench.quick else "distance=100"]
    for floor in all_floors(bench):
        for explorer in bench.cairn.names("explorer"):
            keep(measure(bench, "floors", floor, explorer, explorer, bench.rounds, until))


def study_six(bench: Bench, keep: Keep) -> None:
    """Every explorer on six floors with many seeds, over a distance at which none of the larger floors is done."""
    until = ["--until", "distance=10" if bench.quick else "distance=50"]
    floors = [floor for floor in all_floors(bench) if floor.name in SIX or floor.name.startswith("@")]
    for floor in floors:
        for explorer in sorted([*bench.cairn.names("explorer"), *ALPHA_AT_END]):
            keep(measure(bench, "six", floor, explorer, explorer, bench.rounds, until))


def study_exact(bench: Bench, keep: Keep) -> None:
    """Without noise and without a limit: all that can be reached is to be seen, and nothing hit."""
    exact = ["--odometry", "sigma_xy=1e-6,sigma_theta=1e-6,relative=0", "--lidar", "range_sigma=0",
             *(["--until", "distance=10"] if bench.quick else [])]
    for floor in all_floors(bench):
        keep(measure(bench, "exact", floor, "frontier", "frontier", 1, exact))


def study_sensitivity(bench: Bench, keep: Keep) -> None:
    changes: dict[str, Words] = {
        "as in Table 5.6": action_space(bench), "aperture 90°": action_space(bench, fov=90),
        "aperture 270°": action_space(bench, fov=270), "range 4 m": action_space(bench, reach=4),
        "range 16 m": action_space(bench, reach=16),
        "cells of 0.05 m": [*action_space(bench), "--mapper", "log_odds:resolution=0.05"],
        "cells of 0.2 m": [*action_space(bench), "--mapper", "log_odds:resolution=0.2"]}
    for change, settings in changes.items():
        for method in ["frontier", "drrt_star"]:
            entry = measure(bench, "sensitivity", floor_of(bench, "fr079", "@rooms"), method, method, bench.rounds, settings)
            keep({**entry, "change": change})


# Tables


def floors_sections(entries: list[Json]) -> Sections:
    entries = [entry for entry in entries if text(entry, "part") == "floors"]  # older files have those without noise, too
    rows = []
    before = ""
    for entry in entries:
        name, method = text(entry, "name"), text(entry, "method")
        floor = "" if name == before else name
        if problem_of(entry):
            rows.append([floor, method, "", problem_of(entry), *[""] * 8])
        for run in runs_of(entry)[:LISTED]:
            of = {measure: measured(run, measure)
                  for measure in ["distance", "seen", "loops", "collisions", "ate", "wrong", "decision_p95"]}
            rows.append([floor, method, f"{number(run, 'seed'):.0f}", end_of(run), text(run, "why"), digits(of["distance"]),
                         digits(of["seen"]), whole(of["loops"]), whole(of["collisions"]),
                         *(digits(of[measure]) for measure in ["ate", "wrong", "decision_p95"])])
            floor = ""
        before = name
    return {"explore-floors-means": means_table(entries, MEANS),
            "explore-floors": table(["floor", "explorer", "seed", "end", "why", "driven [m]", "seen [m²]", "loops",
                                     "collisions", "ATE [m]", "wrong [m²]", "95 % of decisions [s]"], rows)}


def exact_sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        name = text(entry, "name")
        if problem_of(entry):
            rows.append([name, problem_of(entry), *[""] * 5])
        for run in runs_of(entry):
            rows.append([name, end_of(run), text(run, "why"), digits(measured(run, "distance")), digits(measured(run, "seen")),
                         percent(measured(run, "reachable_seen"), 1), whole(measured(run, "collisions"))])
    return {"explore-exact": table(["floor", "end", "why", "driven [m]", "seen [m²]", "of what the body can cover",
                                    "collisions"], rows)}


def means_table(entries: list[Json], measures: dict[str, str]) -> str:
    """A row for each measure and floor, a column for each explorer."""
    explorers = list(dict.fromkeys(text(entry, "method") for entry in entries))
    by_place = {(text(entry, "name"), text(entry, "method")): entry for entry in entries}
    rows = []
    for measure_name, title in measures.items():
        for floor in dict.fromkeys(text(entry, "name") for entry in entries):
            cells = [mean_of(by_place[floor, explorer], measure_name).text() if (floor, explorer) in by_place else "-"
                     for explorer in explorers]
            rows.append([title, floor, *cells])
            title = ""
    return table(["mean ± 95 %", "floor", *explorers], rows)


def six_sections(entries: list[Json]) -> Sections:
    return {"explore-six": means_table(entries, SIX_MEANS)}


def sensitivity_sections(entries: list[Json]) -> Sections:
    measures = ["map_entropy", "trajectory_entropy", "loops", "coverage", "map_error", "wrong", "seconds"]
    rows = [[text(entry, "change"), text(entry, "method"),
             *(problem_of(entry) or mean_of(entry, measure).text() for measure in measures)] for entry in entries]
    return {"explore-sensitivity": table(["changed", "method", "map entropy [nats·m²]", "trajectory entropy [nats]",
                                          "loop closures", "coverage [m²]", "map error [m²]", "wrong cells [m²]",
                                          "time of a run [s]"], rows)}


STUDIES = [Study("explore_floors", study_floors, floors_sections),
           Study("explore_six", study_six, six_sections),
           Study("explore_exact", study_exact, exact_sections),
           Study("explore_sensitivity", study_sensitivity, sensitivity_sections)]
