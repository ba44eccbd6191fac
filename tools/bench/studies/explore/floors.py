# SPDX-License-Identifier: BSD-3-Clause
"""A floor without noise, and what the thesis is silent about, changed one by one."""
from __future__ import annotations

from ...data_sets import DataSet
from ...pages import Sections, table
from ...program import Words
from ...reports import Json, number, text
from ...study import Bench, Keep, Study
from ...words import digits, percent, whole
from .runs import all_floors, end_of, floor_of, mean_of, measure, measured, problem_of, runs_of
from .thesis import MOST_RUNS_BEYOND, action_space


def study_exact(bench: Bench, keep: Keep) -> None:
    """Without noise and without a limit: all that can be reached is to be seen, and nothing hit."""
    exact = ["--odometry", "sigma_xy=1e-6,sigma_theta=1e-6,relative=0", "--lidar", "range_sigma=0",
             *(["--until", "distance=10"] if bench.quick else [])]
    for floor in all_floors(bench):
        keep(measure(bench, "exact", floor, "frontier", "frontier", 1, exact))


def study_sensitivity(bench: Bench, keep: Keep) -> None:
    changes: dict[str, Words] = {
        "as in Table 5.6": action_space(bench), "consecutive scans not matched": [*action_space(bench), "--no-consecutive"],
        "aperture 90°": action_space(bench, fov=90),
        "aperture 270°": action_space(bench, fov=270), "range 4 m": action_space(bench, reach=4),
        "range 16 m": action_space(bench, reach=16),
        "cells of 0.05 m": [*action_space(bench), "--mapper", "log_odds:resolution=0.05"],
        "cells of 0.2 m": [*action_space(bench), "--mapper", "log_odds:resolution=0.2"],
        "evidence of a hit 0.9": [*action_space(bench), "--mapper", "log_odds:hit=0.9"]}
    for change, settings in changes.items():
        for method in ["frontier", "drrt_star"]:
            entry = measure(bench, "sensitivity", floor_of(bench, "fr079", "@rooms"), method, method,
                            min(bench.rounds, MOST_RUNS_BEYOND), settings)
            keep({**entry, "change": change})


# Tables


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


def sensitivity_sections(entries: list[Json]) -> Sections:
    measures = ["map_entropy", "trajectory_entropy", "loops", "coverage", "map_error", "wrong", "seconds"]
    rows = [[text(entry, "change"), text(entry, "method"),
             *(problem_of(entry) or mean_of(entry, measure).text() for measure in measures)] for entry in entries]
    return {"explore-sensitivity": table(["changed", "method", "map entropy [nats·m²]", "trajectory entropy [nats]",
                                          "loop closures", "coverage [m²]", "map error [m²]", "wrong cells [m²]",
                                          "time of a run [s]"], rows)}


STUDIES = [Study("explore_exact", study_exact, exact_sections),
           Study("explore_sensitivity", study_sensitivity, sensitivity_sections)]
