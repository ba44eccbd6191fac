# SPDX-License-Identifier: BSD-3-Clause
"""Tables 5.4 to 5.6 of the thesis: search in configuration space and in action space; and the latter at the scale that the
thesis's floor likely had, and on other floors."""
from __future__ import annotations

import math
from collections.abc import Callable

from ...averages import ratio
from ...pages import Sections, table
from ...program import Words
from ...published import said
from ...reports import Json, member, text
from ...study import Bench, Keep, Study, tell
from ...words import times
from .claims import CLAIMS, claim_verdicts, claims_table
from .floor_views import viewed
from .runs import (MAP_ERROR_AT_COVERAGE, WRONG_AT_SEEN, difference_of, ends_of, floor_of, mean_of, measure, runs_of)

# What all of them have in common; the aperture, range and beams of the lidar are silent, and so is `loop_gain`:
# docs/explore_results.md has where it is from.
# Consecutive scans are matched, as by default; the thesis does not say whether its robot does so.
COMMON = ["--policy", "compact_pose:range=1,angle=0.35,reuse=false,gate=0.9999,loop_gain=6",
          "--match", "range=1,angle=0.35,sigma_xy=0.05,sigma_theta=0.0017"]


def configuration_space(bench: Bench) -> Words:
    """E1 and E2 (5.3.3): noise per step."""
    return [*COMMON, "--odometry", "sigma_xy=0.1,sigma_theta=0.0026,relative=0", "--lidar", "fov=180,range=8,beams=181",
            "--until", "steps=30,decisions=15" if bench.quick else "steps=200,decisions=100"]


def action_space(bench: Bench, fov: int = 180, reach: int = 8) -> Words:
    """E3 (5.4.5): odometry's noise is 15 % of the motion, with a least one. The lidar has a beam for each degree of `fov`, and
    a range of `reach` [m]."""
    return [*COMMON, "--odometry", "relative=0.15,sigma_xy=0.01,sigma_theta=0.0052", "--lidar",
            f"fov={fov},range={reach},beams={fov + 1},range_sigma=0.05", "--until",
            "distance=15" if bench.quick else "distance=250"]


# The methods of the thesis, and beyond: frontiers by exact paths, and by chance.
CONFIGURATION_SPACE = {"frontier": "frontier:length=0.5,smallest=0.1,keep=1,planner=rrt_star", "ede_gradient": "ede_gradient",
                       "ede_rrt_star": "ede_rrt_star", "ours: frontier": "frontier", "ours: dopt": "dopt"}
ACTION_SPACE = {"frontier": "frontier:length=0.9,keep=1,planner=rrt_star",
                "heuristic": "heuristic:keep=1,planner=rrt_star,entropy=thesis,revisits=0", "ede_rrt_star": "ede_rrt_star",
                "drrt_star": "drrt_star:revisits=0", "errt_star": "errt_star:revisits=0", "ours: frontier": "frontier", "ours: dopt": "dopt",
                "ours: random": "random"}
METHODS_OF_THESIS = {name: explorer for name, explorer in ACTION_SPACE.items() if not name.startswith("ours")}
MOST_RUNS_BEYOND = 10  # of each method that the thesis does not have
# Other floors: of the data, turned, and drawn; what stands for them where there is no data.
OTHER_FLOORS = [("intel_lab", "as it is", "@corridor"), ("fr079", "31°", "@loop"), ("intel_lab", "17°", "@corridor:seed=3"),
                ("@rooms:seed=7", "as it is", "@rooms:seed=7"), ("@corridor:seed=7", "as it is", "@corridor:seed=7")]


def part_study(part: str, floor: str, generated: str, methods: dict[str, str], settings: Callable[[Bench], Words]) -> Study:
    def study(bench: Bench, keep: Keep) -> None:
        for method, explorer in methods.items():
            rounds = min(bench.rounds, MOST_RUNS_BEYOND) if method.startswith("ours") else bench.rounds
            keep(measure(bench, part, floor_of(bench, floor, generated), method, explorer, rounds, settings(bench)))

    return Study(f"explore_{part}", study, sections)


def study_figures(bench: Bench, keep: Keep) -> None:
    """The first run of each of the thesis's methods, recorded for its figures of maps and trees (5.6, 5.9, 5.13 and 5.15)."""
    parts = {"cave": ("cave_20m", "@cave", CONFIGURATION_SPACE, configuration_space(bench)),
             "freiburg": ("fr079", "@corridor", CONFIGURATION_SPACE, configuration_space(bench)),
             "action": ("fr079", "@rooms", ACTION_SPACE, action_space(bench))}
    for part, (floor, generated, methods, settings) in parts.items():
        for method, explorer in methods.items():
            if not method.startswith("ours"):
                record = str(bench.cairn.work / f"figure_{part}_{method}.jsonl")
                tell(f"explore, figures: {method}, {part}")
                run = bench.cairn.on("explore", floor_of(bench, floor, generated),
                                     ["--explorer", explorer, "--record", record, *settings], limit=3600.0)
                keep({"part": part, "method": method, "done": run.report is not None})


def study_elsewhere(bench: Bench, keep: Keep) -> None:
    for name, view, generated in OTHER_FLOORS:
        floor = viewed(bench, floor_of(bench, name, generated), view)
        for method, explorer in METHODS_OF_THESIS.items():
            keep(measure(bench, "elsewhere", floor, method, explorer, bench.rounds, action_space(bench)))


# Tables

ROWS = {"map_entropy": "map entropy [nats·m²]", "trajectory_entropy": "trajectory entropy [nats]",
        "seconds": "time of a run [s]", "loops": "loop closures", "coverage": "coverage [m²]", "map_error": "map error [m²]",
        "seen": "of the floor seen [m²]", "wrong": "wrong cells [m²]", "ate": "ATE [m]", "collisions": "collisions",
        "distance": "driven [m]", "poses": "poses kept", "decisions": "decisions",
        "decision_median": "a decision: median [s]", "decision_p95": "95 % [s]", "decision_max": "longest [s]"}
# From the first method, seed by seed.
APART = {MAP_ERROR_AT_COVERAGE: "map error at equal coverage [m²], less frontier's",
         WRONG_AT_SEEN: "wrong cells, as much floor seen [m²], less frontier's"}
ELSEWHERE = ["loops", "seen", "map_entropy", "trajectory_entropy", "ate", "collisions", "seconds", "decision_p95"]
IN_THESIS = ["map_entropy", "trajectory_entropy", "seconds", "loops", "coverage", "map_error"]
# How long the thesis's runs are (5.4.5 and 5.3.3).
THESIS_DISTANCE, THESIS_MOTIONS = 250.0, 200.0  # [m], motions


def in_thesis(part: str, method: Json, measure: str) -> float:
    return said("vallve2018_exploration", measure, part=part, method=text(method, "method"))


def starred(method: Json, reference: Json, measure: str) -> str:
    """The mean, with a star where the difference from the reference, seed by seed, is clear of zero."""
    star = " *" if method is not reference and difference_of(method, reference, measure).excludes_zero() else ""
    return mean_of(method, measure).text() + star


def apart(method: Json, reference: Json, measure: str) -> str:
    """The difference from the reference, seed by seed, with such a star."""
    if method is reference:
        return ""
    difference = difference_of(method, reference, measure)
    return difference.text(sign=True) + (" *" if difference.excludes_zero() else "")


def results_table(part: str, methods: list[Json]) -> str:
    """"ours ± interval (the thesis's)"."""
    rows = []
    reference = methods[0]
    for measure_name, title in ROWS.items():
        cells = [title]
        for method in methods:
            thesis = in_thesis(part, method, measure_name) if measure_name in IN_THESIS else math.nan
            cells.append(starred(method, reference, measure_name) + (f" ({thesis:.6g})" if math.isfinite(thesis) else ""))
        rows.append(cells)
    for measure_name, title in APART.items():
        rows.append([title, *(apart(method, reference, measure_name) for method in methods)])
    # Runs may be shorter than the thesis's: times are compared per metre, or per motion.
    unit, of, length = ("metre", "distance", THESIS_DISTANCE) if part == "action" else ("motion", "motions", THESIS_MOTIONS)
    faster = [times(ratio(in_thesis(part, method, "seconds") / length * mean_of(method, of).mean,
                          mean_of(method, "seconds").mean)) for method in methods]
    rows += [[f"the thesis's time per {unit} over ours", *faster], ["ends", *map(ends_of, methods)],
             ["runs", *(str(len(runs_of(method))) for method in methods)]]
    return table(["mean ± 95 % (thesis)", *(text(method, "method") for method in methods)], rows)


def setting_of(methods: list[Json]) -> str:
    """A floor and how it was driven on, below the tables."""
    for method in methods:
        if report := member(method, "report"):
            return (f"\nOn `{text(method, 'name')}`; world `{text(report, 'world')}`, policy `{text(report, 'policy')}`, "
                    f"registration `{text(report, 'registration')}`, mapper `{text(report, 'mapper')}`.\n")
    return "\nNothing was measured.\n"


def sections(methods: list[Json]) -> Sections:
    if not methods:
        return {}
    part = text(methods[0], "part")
    thesis = "action" if part == "scale" else part  # at the other scale the thesis's figures are those of the same table
    return {f"explore-{part}": results_table(thesis, methods) + setting_of(methods),
            f"explore-{part}-claims": claims_table(thesis, methods)}


def elsewhere_sections(entries: list[Json]) -> Sections:
    """A row for each floor and measure; and the claims, with a column for each floor."""
    rows, verdicts = [], {}
    floors, names = (list(dict.fromkeys(text(entry, of) for entry in entries)) for of in ["name", "method"])
    for floor in floors:
        methods = [entry for entry in entries if text(entry, "name") == floor]
        verdicts[floor] = claim_verdicts("action", methods)
        title = floor
        for measure_name in ELSEWHERE:
            rows.append([title, ROWS[measure_name], *(starred(method, methods[0], measure_name) for method in methods)])
            title = ""
        for measure_name, apart_title in APART.items():
            rows.append(["", apart_title, *(apart(method, methods[0], measure_name) for method in methods)])
        rows.append(["", "ends", *map(ends_of, methods)])
    claims = [[claim, *(verdicts[floor][claim] for floor in floors)] for claim in CLAIMS["action"]]
    return {"explore-elsewhere": table(["floor", "mean ± 95 % of", *names], rows),
            "explore-elsewhere-claims": table(["claim", *floors], claims)}


STUDIES = [part_study("cave", "cave_20m", "@cave", CONFIGURATION_SPACE, configuration_space),
           part_study("freiburg", "fr079", "@corridor", CONFIGURATION_SPACE, configuration_space),
           part_study("action", "fr079", "@rooms", ACTION_SPACE, action_space),
           part_study("scale", "fr079_thesis_scale", "@rooms", ACTION_SPACE, action_space),
           Study("explore_elsewhere", study_elsewhere, elsewhere_sections),
           Study("explore_figures", study_figures, lambda entries: {})]
