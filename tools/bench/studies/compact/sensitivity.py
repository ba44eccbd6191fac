# SPDX-License-Identifier: BSD-3-Clause
"""Loops kept and errors against the threshold on the gain of a loop; and with everything as by default, as a robot has it:
how much is kept and asked for, and the error beside those of all loop closures, of a random choice and of odometry."""
from __future__ import annotations

import pandas as pd

from ...averages import ratio
from ...data_sets import DataSet, compact_sets_named, live_sets
from ...pages import Sections, table
from ...program import Words
from ...reports import Json, contestant, items, median_of, number, text
from ...rounds import Contestant
from ...study import Bench, Keep, Study, attempt, for_each_set
from ...words import digits, megabytes, plain, whole
from .runs import (ALL_LOOPS, AS_PUBLISHED, BY_RULE, error_of, find_thresholds, named_once, over, part_kept, run_compact, run_seeds,
                   summary, with_dagger, with_truth)
from .sets import LIMIT

FACTORS = [0.0, 0.125, 0.25, 0.5, 0.707, 1.0, 1.41, 2.0, 2.83, 4.0, 8.0]


def measure_gains(bench: Bench, plain_data: DataSet) -> Json:
    """All poses, and loops with a threshold on their gain alone: multiples of the rule's, and none."""
    data = with_truth(bench, plain_data)
    rule = find_thresholds(bench, data, "gain", BY_RULE)
    gain = float(text(rule.found, "options.loop_gain"))

    def run(*more: str) -> Json:
        return summary(run_compact(bench, data, ["--thresholds", rule.file, *more]).report)

    runs = [{"factor": factor, "loop_gain": factor * gain,
             "run": run("--strategy", "apfl", "--policy", AS_PUBLISHED, "--loop-gain", plain(factor * gain))}
            for factor in FACTORS]
    return {"name": data.name, "apal": run("--strategy", "apal", "--policy", ALL_LOOPS), "runs": runs}


def study_gain(bench: Bench, keep: Keep) -> None:
    sets = compact_sets_named(["ellipse3d", "sphere2500", "kitti_00, simulated"], bench.data, bench.quick)
    for_each_set("compact, gains", sets, lambda data: keep(measure_gains(bench, data)))


def measure_live(bench: Bench, plain_data: DataSet, sensor: Words) -> Json:
    """Everything as by default. What has a limit of time may have no run."""
    data = with_truth(bench, plain_data)
    found: Json = {}
    if not sensor:
        thresholds = find_thresholds(bench, data, "live")
        sensor, found = ["--thresholds", thresholds.file], thresholds.found

    def with_strategy(name: str, strategy: str) -> Contestant:
        return Contestant(name, [*sensor, "--strategy", strategy], LIMIT)

    # No loop closure is used: what is left is odometry.
    odometry = Contestant("odometry", ["--range", "0.001", "--angle", "0.001", "--loop-gain", "1e9"], LIMIT)
    contestants = [run_seeds(bench, data, one, 1) for one in [with_strategy("fpfl", "fpfl"), with_strategy("apal", "apal"), odometry]]
    contestants.append(run_seeds(bench, data, with_strategy("random", "rfpfl"), 2 if bench.quick else 5,
                                 lambda seed: ["--seed", str(seed)]))
    return {"name": data.name, "de_facto": data.truth == "de_facto", "thresholds": found,
            "contestants": [one.entry() for one in contestants]}


def study_live(bench: Bench, keep: Keep) -> None:
    def measure(data: DataSet, sensor: Words) -> None:
        attempt(f"compact, live: {data.name}", lambda: keep(measure_live(bench, data, sensor)))

    for data, sensor in live_sets(bench.data, bench.quick):
        measure(data, sensor)


# Tables


def gain_sections(entries: list[Json]) -> Sections:
    """The top of the paper's Figure 5."""
    rows = []
    for entry in entries:
        apal, some = number(entry, "apal.errors.v2.ate.translation"), []
        for run in items(entry, "runs"):
            error, kept = number(run, "run.errors.v2.ate.translation"), number(run, "run.loops.kept")
            some.append([f"{number(run, 'factor'):.3g}", digits(number(run, "loop_gain")), whole(kept),
                         part_kept(kept, number(run, "run.loops.in")), digits(error),
                         digits(number(run, "run.errors.v2.ate.rotation")), over(error, apal)])
        rows += named_once(some, text(entry, "name"))
    return {"compact-gain": table(["graph", "threshold over the rule's", "gain threshold [nats]", "loops kept", "of all",
                                   "ATE [m]", "ATE [°]", "over APAL's"], rows)}


def gain_curves(entries: list[Json]) -> dict[str, str]:
    """Loop closures kept and errors against the threshold, as CSV."""
    first = "threshold over the rule's"
    curves = pd.DataFrame()
    for entry in entries:
        runs, name = items(entry, "runs"), text(entry, "name")
        factors = [number(run, "factor") for run in runs]
        if curves.empty:
            curves[first] = factors
        if list(curves[first]) != factors:
            continue  # of another version of the study
        apal = number(entry, "apal.errors.v2.ate.translation")
        curves[f"loop closures kept [%], {name}"] = [100.0 * ratio(number(run, "run.loops.kept"), number(run, "run.loops.in"))
                                                     for run in runs]
        curves[f"ATE over that of APAL, {name}"] = [ratio(number(run, "run.errors.v2.ate.translation"), apal) for run in runs]
    return {"compact_gain.csv": curves.to_csv(index=False)} if entries else {}


def live_sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        kept = contestant(entry, "fpfl")
        asked, poses, loops = (median_of(kept, of) for of in ["loops.proposed", "poses.in", "loops.kept"])
        row = [with_dagger(entry), whole(median_of(kept, "poses.kept")), whole(poses), whole(loops), digits(ratio(asked, poses)),
               digits(ratio(asked, loops)), megabytes(median_of(kept, "peak_memory_bytes"))]
        for name in ["fpfl", "apal", "random", "odometry"]:
            row += [digits(error_of(contestant(entry, name), f"ate.{of}", "likely")) for of in ["translation", "rotation"]]
        rows.append(row)
    return {"compact-live": table(["graph", "poses kept", "of", "loops kept", "pairs asked for per pose", "per loop kept",
                                   "memory [MB]", "ATE [m]", "ATE [°]", "all loops: ATE [m]", "all loops: ATE [°]",
                                   "random: ATE [m]", "random: ATE [°]", "odometry: ATE [m]", "odometry: ATE [°]"], rows)}


STUDIES = [Study("compact_gain", study_gain, gain_sections, gain_curves), Study("compact_live", study_live, live_sections)]
