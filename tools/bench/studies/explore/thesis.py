# SPDX-License-Identifier: BSD-3-Clause
"""Tables 5.4 to 5.6 of the thesis: search in configuration space and in action space; and the latter at the scale that the
thesis's floor likely had, and on other floors."""
from __future__ import annotations

import math
from collections.abc import Callable

from ...averages import ratio
from ...intervals import MeanInterval
from ...pages import Sections, table
from ...program import Words
from ...published import said
from ...reports import Json, member, text
from ...study import Bench, Keep, Study, tell
from ...words import times
from .claims import claims_table
from .runs import (MAP_ERROR_AT_COVERAGE, WRONG_AT_SEEN, difference_of, ends_of, floor_of, mean_of, measure, runs_of)

# What all of them have in common; the aperture, range and beams of the lidar are silent, and so is `loop_gain`:
# docs/explore_results.md has where it is from.
# The tables were measured without matches of consecutive scans, on which the thesis is silent.
COMMON = ["--no-consecutive", "--policy", "compact_pose:range=1,angle=0.35,reuse=false,gate=0.9999,loop_gain=6",
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
# The weight of the map from the pose at the end of each path, the former default (docs/explore.md).
ALPHA_AT_END = {f"{name}:alpha=end": f"{name}:alpha=end,revisits=0" for name in ["drrt_star", "errt_star"]}
MOST_RUNS_BEYOND = 10  # of each method that the thesis does not have
# On other floors the claim that counts is tried: a better map at equal coverage.
ELSEWHERE = {"frontier": ACTION_SPACE["frontier"], "drrt_star": ACTION_SPACE["drrt_star"],
             "drrt_star:alpha=end": ALPHA_AT_END["drrt_star:alpha=end"]}
OTHER_FLOORS = {"intel_lab": "@corridors", "stata_basement": "@loop"}


def part_study(part: str, floor: str, generated: str, methods: dict[str, str], settings: Callable[[Bench], Words]) -> Study:
    def study(bench: Bench, keep: Keep) -> None:
        for method, explorer in methods.items():
            rounds = min(bench.rounds, MOST_RUNS_BEYOND) if method.startswith("ours") else bench.rounds
            keep(measure(bench, part, floor_of(bench, floor, generated), method, explorer, rounds, settings(bench)))

    return Study(f"explore_{part}", study, sections)


def study_figures(bench: Bench, keep: Keep) -> None:
    """The first run of each of the thesis's methods, recorded for its figures of maps and trees (5.6, 5.9, 5.13 and 5.15)."""
    parts = {"cave": ("cave_20m", "@cave", CONFIGURATION_SPACE, configuration_space(bench)),
             "freiburg": ("fr079", "@corridors", CONFIGURATION_SPACE, configuration_space(bench)),
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
    for floor, generated in OTHER_FLOORS.items():
        for method, explorer in ELSEWHERE.items():
            entry = measure(bench, f"elsewhere_{floor}", floor_of(bench, floor, generated), method, explorer, bench.rounds,
                            action_space(bench))
            keep({**entry, "part": "elsewhere"})


# Tables

ROWS = {"map_entropy": "map entropy [nats·m²]", "trajectory_entropy": "trajectory entropy [nats]",
        "seconds": "time of a run [s]", "loops": "loop closures", "coverage": "coverage [m²]", "map_error": "map error [m²]",
        "seen": "of the floor seen [m²]", "wrong": "wrong cells [m²]", "ate": "ATE [m]", "collisions": "collisions",
        "distance": "driven [m]", "poses": "poses kept", "decisions": "decisions",
        "decision_median": "a decision: median [s]", "decision_p95": "95 % [s]", "decision_max": "longest [s]"}
IN_THESIS = ["map_entropy", "trajectory_entropy", "seconds", "loops", "coverage", "map_error"]
# How long the thesis's runs are (5.4.5 and 5.3.3).
THESIS_DISTANCE, THESIS_MOTIONS = 250.0, 200.0  # [m], motions


def in_thesis(part: str, method: Json, measure: str) -> float:
    return said("vallve2018_exploration", measure, part=part, method=text(method, "method"))


def results_table(part: str, methods: list[Json]) -> str:
    """"ours ± interval (the thesis's)"."""
    rows = []
    for measure_name, title in ROWS.items():
        cells = [title]
        for method in methods:
            thesis = in_thesis(part, method, measure_name) if measure_name in IN_THESIS else math.nan
            cells.append(mean_of(method, measure_name).text() + (f" ({thesis:.6g})" if math.isfinite(thesis) else ""))
        rows.append(cells)
    # Runs may be shorter than the thesis's: times are compared per metre, or per motion.
    unit, of, length = ("metre", "distance", THESIS_DISTANCE) if part == "action" else ("motion", "motions", THESIS_MOTIONS)
    faster = [times(ratio(in_thesis(part, method, "seconds") / length * mean_of(method, of).mean,
                          mean_of(method, "seconds").mean)) for method in methods]
    rows += [[f"the thesis's time per {unit} over ours", *faster], ["ends", *map(ends_of, methods)],
             ["runs", *(str(len(runs_of(method))) for method in methods)]]
    return table(["mean ± 95 % (thesis)", *(text(method, "method") for method in methods)], rows)


def differences_table(methods: list[Json]) -> str:
    reference, others = methods[0], methods[1:]
    if not others:
        return ""
    measures = {name: title for name, title in ROWS.items() if not name.startswith("decision")}
    measures |= {MAP_ERROR_AT_COVERAGE: "map error at equal coverage [m²]", WRONG_AT_SEEN: "wrong cells, as much floor seen [m²]"}
    rows = []
    for name, title in measures.items():
        differences = [difference_of(method, reference, name) for method in others]
        rows.append([title, *(one.text(sign=True) + (" *" if one.excludes_zero() else "") for one in differences)])
    return table(["difference from frontier", *(text(method, "method") for method in others)], rows)


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
            f"explore-{part}-differences": differences_table(methods),
            f"explore-{part}-claims": claims_table(thesis, methods)}


def elsewhere_sections(entries: list[Json]) -> Sections:
    """A row for each floor and measure, with the differences from the first method on that floor."""
    rows = []
    measures = {name: title for name, title in ROWS.items() if not name.startswith("decision_m") and name != "coverage"}
    measures |= {MAP_ERROR_AT_COVERAGE: "map error at equal coverage [m²]", WRONG_AT_SEEN: "wrong cells, as much floor seen [m²]"}
    names = list(dict.fromkeys(text(entry, "method") for entry in entries))
    for floor in dict.fromkeys(text(entry, "name") for entry in entries):
        methods = {text(entry, "method"): entry for entry in entries if text(entry, "name") == floor}
        reference = methods.get(names[0])
        title = floor
        for measure_name, measure_title in measures.items():
            means = [mean_of(methods[name], measure_name).text() if name in methods else "-" for name in names]
            apart = [difference_of(methods[name], reference, measure_name) if reference and name in methods else MeanInterval()
                     for name in names[1:]]
            rows.append([title, measure_title, *means,
                         *(one.text(sign=True) + (" *" if one.excludes_zero() else "") for one in apart)])
            title = ""
        rows.append(["", "ends", *(ends_of(methods[name]) if name in methods else "-" for name in names),
                     *[""] * (len(names) - 1)])
    return {"explore-elsewhere": table(["floor", "mean ± 95 % of", *names, *(f"{name} − {names[0]}" for name in names[1:])], rows)}


STUDIES = [part_study("cave", "cave_20m", "@cave", CONFIGURATION_SPACE, configuration_space),
           part_study("freiburg", "fr079", "@corridors", CONFIGURATION_SPACE, configuration_space),
           part_study("action", "fr079", "@rooms", ACTION_SPACE | ALPHA_AT_END, action_space),
           part_study("scale", "fr079_thesis_scale", "@rooms", ACTION_SPACE, action_space),
           Study("explore_elsewhere", study_elsewhere, elsewhere_sections),
           Study("explore_figures", study_figures, lambda entries: {})]
