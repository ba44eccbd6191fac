# SPDX-License-Identifier: BSD-3-Clause
"""The graphs of Ila et al. (2017), and others: thresholds, times, errors."""
from __future__ import annotations

import math

from ...averages import median, ratio
from ...data_sets import DataSet, compact_sets
from ...pages import Sections, table
from ...published import said
from ...reports import Json, contestant, items, median_of, number, paired_ratio, text, was_late
from ...rounds import Contestant, entries_of, run_rounds
from ...study import Bench, Keep, Study, for_each_set
from ...words import digits, milliseconds, times, total, whole
from .runs import (ALL_LOOPS, ERRORS, Thresholds, ate, contestants_with, error_of, find_both_thresholds, named_once, over, part_kept,
                   run_compact, run_seeds, summary, tenths, with_dagger, with_truth)

# A run is given up after so many seconds, and repeated as long as all together take less than this: the studies of
# `cairn compact` are to take half an hour.
LIMIT, ENOUGH = 300.0, 60.0
# Without a distance test a run is quadratic, and needed but once: its errors are always the same.
UNTESTED_LIMIT = 1200.0


def all_of_all(bench: Bench, data: DataSet, thresholds: Thresholds, tested: Contestant) -> Contestant:
    """All poses and every loop closure. Where the distance test loses none, that run is the same."""
    apal = Contestant("apal", ["--strategy", "apal", "--policy", ALL_LOOPS, "--thresholds", thresholds.file], UNTESTED_LIMIT)
    if tested.runs and tested.runs[0]["loops"]["kept"] == tested.runs[0]["loops"]["in"]:
        apal.runs = tested.runs
        return apal
    return run_seeds(bench, data, apal, 1)


def has_converged(bench: Bench, data: DataSet, graph: str, chi2: float) -> bool:
    """Whether the graph is at the minimum that an optimiser finds from another initial estimate."""
    same = 1e-6
    run = bench.cairn.optimize(DataSet(data.name, graph, data.arguments), ["--initial", "chordal"])
    return text(run.report, "status") == "converged" and chi2 <= (1.0 + same) * number(run.report, "chi2.final") + same


def measure_control(bench: Bench, plain: DataSet, data: DataSet, thresholds: Thresholds, name: str, draw: str) -> Json:
    """As many poses and loops as with the thresholds found, drawn at random; how many of the runs have converged."""
    graph = str(bench.cairn.work / "control.g2o")
    control = Contestant(name, ["--strategy", "rfpfl", "--draw", draw, "--thresholds", thresholds.file, "-o", graph], LIMIT)
    converged = 0
    for seed in range(1, 3 if bench.quick else 6):
        run = run_compact(bench, data, [*control.arguments, "--seed", str(seed)], control.limit)
        control.take(run, summary)
        if not control.in_time:
            break
        converged += has_converged(bench, plain, graph, number(run.report, "chi2.final"))
    return {**control.entry(), "converged": converged}


def measure_set(bench: Bench, plain: DataSet) -> Json:
    data = with_truth(bench, plain)
    thresholds = find_both_thresholds(bench, data)
    contestants = contestants_with(thresholds, LIMIT, ENOUGH)
    run_rounds(bench.rounds_of_runs, contestants, lambda c: run_compact(bench, data, c.arguments, c.limit), summary)
    found = thresholds["found"]
    contestants.append(all_of_all(bench, data, found, contestants[0]))
    controls = [measure_control(bench, plain, data, found, name, draw)
                for name, draw in [("random", "loops"), ("random_poses", "poses")]]
    return {"name": data.name, "de_facto": data.truth == "de_facto", **{of: t.found for of, t in thresholds.items()},
            "contestants": [*entries_of(contestants), *controls]}


def study_sets(bench: Bench, keep: Keep) -> None:
    for_each_set("compact", compact_sets(bench.data, bench.quick), lambda data: keep(measure_set(bench, data)))


# Tables


def paper_name(entry: Json) -> str:
    """Also of a graph that is simulated after the paper's: "kitti_00, simulated"."""
    return text(entry, "name").partition(",")[0]


def of_paper(entry: Json, column: str) -> float:
    return said("ila2017_graphs", column, graph=paper_name(entry))


def is_of_paper(entry: Json) -> bool:
    return math.isfinite(of_paper(entry, "range"))


def thresholds_table(entries: list[Json]) -> str:
    rows = []
    options = ["range", "angle", "probability", "pose_gain", "loop_gain"]
    for entry in entries:
        some = []
        if is_of_paper(entry):
            some.append(["the paper's", *(digits(of_paper(entry, option)) for option in options), "", ""])
        for found, title in [("by_rule", "by the rule"), ("found", "found")]:
            # Options are kept as they are written on the command line.
            values = [text(entry, f"{found}.options.{option}") for option in options]
            some.append([title, *(digits(float(value)) if value else "-" for value in values),
                         str(len(items(entry, f"{found}.trials"))), digits(number(entry, f"{found}.seconds"))])
        rows += named_once(some, text(entry, "name"))
    return table(["graph", "thresholds", "range [m]", "angle [rad]", "s", "gain threshold, poses", "gain threshold, loops",
                  "tries", "found in [s]"], rows)


def part_of(c: Json, what: str) -> str:
    return part_kept(median_of(c, f"{what}.kept"), median_of(c, f"{what}.in"))


def faster(apal: Json, fpfl: Json) -> str:
    """Of one that was given up it is known that it is more."""
    if not was_late(apal):
        return times(paired_ratio(apal, fpfl))
    return "> " + times(number(apal, "limit") / median_of(fpfl, "seconds.total"))


def times_table(entries: list[Json]) -> str:
    rows = []
    for entry in entries:
        apal, fpfl = contestant(entry, "tested"), contestant(entry, "fpfl")
        graph = [text(entry, "name"), whole(median_of(fpfl, "poses.in")), whole(median_of(fpfl, "loops.in"))]
        for name, title in [("fpfl", "found"), ("by_rule", "as published")]:
            c = contestant(entry, name)
            rows.append([*graph, title, total(apal), total(c), faster(apal, c), part_of(c, "loops"), part_of(c, "poses"),
                         milliseconds(median_of(apal, "steps.p99")), milliseconds(median_of(c, "steps.p99"))])
            graph = ["", "", ""]
        if is_of_paper(entry):
            seconds = [of_paper(entry, f"{who}_seconds") for who in ["apal", "fpfl"]]
            rows.append([*graph, "the paper's", *map(digits, seconds), times(seconds[0] / seconds[1]),
                         tenths(of_paper(entry, "loops")), tenths(of_paper(entry, "poses")), "", ""])
    return table(["graph", "poses", "loops", "thresholds", "APAL [s]", "FPFL [s]", "faster", "loops kept", "poses kept",
                  "99 % of APAL's steps [ms]", "of FPFL's"], rows)


# A strategy with one way of putting poses back.
ESTIMATES = [("APAL", "apal", "v2"), ("APAL, distance test", "tested", "v2"), ("FPFL", "fpfl", "v2"),
             ("FPFL, `likely`", "fpfl", "likely"), ("FPFL as published", "by_rule", "v2"),
             ("RFPFL, loops first", "random", "v2"), ("RFPFL, poses first", "random_poses", "v2")]


def errors_of_paper(entry: Json, strategy: str) -> list[float]:
    """As they should be: the paper divides the sum over the n (n - 1) / 2 pairs of all to all by n², so its root mean squares
    are 1/√2 of what they should be."""
    errors = [said("ila2017_errors", error, graph=paper_name(entry), strategy=strategy) for error in ERRORS]
    return errors[:4] + [math.sqrt(2.0) * error for error in errors[4:]]


def errors_table(entries: list[Json]) -> str:
    rows = []
    for entry in entries:
        apal, fpfl = ate(contestant(entry, "apal")), ate(contestant(entry, "fpfl"))
        some = []
        for title, name, recovery in ESTIMATES:
            errors = [error_of(contestant(entry, name), error, recovery) for error in ERRORS]
            some.append([title, *map(digits, errors), "" if name == "apal" else over(errors[0], apal),
                         over(errors[0], fpfl) if name.startswith("random") else ""])
        for strategy in ["APAL", "FPFL", "RFPFL"]:
            errors = errors_of_paper(entry, strategy)
            if math.isfinite(errors[0]):
                some.append([f"the paper's {strategy}", *map(digits, errors),
                             "" if strategy == "APAL" else over(errors[0], errors_of_paper(entry, "APAL")[0]),
                             over(errors[0], errors_of_paper(entry, "FPFL")[0]) if strategy == "RFPFL" else ""])
        rows += named_once(some, with_dagger(entry))
    return table(["graph", "strategy", "ATE [m]", "ATE [°]", "RPE [m]", "RPE [°]", "all to all [m]", "all to all [°]",
                  "ATE over APAL's", "ATE over FPFL's"], rows)


def control_table(entries: list[Json]) -> str:
    """What the control got, which may be fewer loops than asked for where poses are drawn first."""
    rows = []
    for entry in entries:
        fpfl, some = contestant(entry, "fpfl"), []
        for name, title in [("random", "loops"), ("random_poses", "poses")]:
            c = contestant(entry, name)
            ratios = [ratio(number(run, "errors.v2.ate.translation"), ate(fpfl)) for run in items(c, "runs")]
            if ratios:
                some.append([title, whole(median_of(c, "poses.kept")), whole(median_of(c, "loops.kept")),
                             whole(median_of(fpfl, "loops.kept")), f"{number(c, 'converged'):.0f} of {len(ratios)}",
                             times(min(ratios)), times(median(ratios)), times(max(ratios))])
        rows += named_once(some, text(entry, "name"))
    return table(["graph", "drawn first", "poses kept", "loops kept", "FPFL's loops", "converged",
                  "ATE over FPFL's: least", "ATE over FPFL's: median", "ATE over FPFL's: most"], rows)


def recovery_table(entries: list[Json]) -> str:
    """The paper's Table 1, which is of kitti_00."""
    rows = []
    for entry in entries:
        some, paper = [], []
        for recovery in ["v0", "v1", "v2", "likely"]:
            errors = [error_of(contestant(entry, "by_rule"), error, recovery) for error in ERRORS]
            some.append([recovery, *map(digits, errors)])
            errors = errors_of_paper(entry, recovery)
            if math.isfinite(errors[0]):
                paper.append([f"the paper's {recovery}", *map(digits, errors)])
        rows += named_once(some + paper, text(entry, "name"))
    return table(["graph", "recovery", "ATE [m]", "ATE [°]", "RPE [m]", "RPE [°]", "all to all [m]", "all to all [°]"],
                 rows)


def sections(entries: list[Json]) -> Sections:
    return {"compact-thresholds": thresholds_table(entries), "compact-times": times_table(entries),
            "compact-errors": errors_table(entries), "compact-control": control_table(entries),
            "compact-recovery": recovery_table(entries)}


STUDIES = [Study("compact_sets", study_sets, sections)]
