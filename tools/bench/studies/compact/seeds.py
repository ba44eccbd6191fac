# SPDX-License-Identifier: BSD-3-Clause
"""How much of a ratio of errors is the draw of the noise: the world of the paper's ellipse3D with many seeds."""
from __future__ import annotations

from ...averages import median, percentile, ratio
from ...data_sets import DataSet, ellipse3d
from ...intervals import median_interval
from ...pages import Sections, table
from ...published import said
from ...reports import Json, items, number, text
from ...study import Bench, Keep, Study, attempt
from ...words import digits, percent, times
from .runs import ALL_LOOPS, AS_PUBLISHED, BY_RULE, TITLES, Thresholds, find_thresholds, named_once, run_compact

SEEDS, FEW = 100, 10


def ate_of(bench: Bench, data: DataSet, strategy: str, thresholds: Thresholds, policy: str = "") -> Json:
    report = run_compact(bench, data, ["--strategy", strategy, "--thresholds", thresholds.file,
                                       *(["--policy", policy] if policy else [])]).report
    return {"ate": number(report, "errors.v2.ate.translation"), "poses": number(report, "poses.kept"),
            "loops": number(report, "loops.kept")}


def measure_seed(bench: Bench, seed: int) -> Json:
    """Thresholds are found anew each time, as for a single data set."""
    data = ellipse3d(f",seed={seed}")
    by_rule = find_thresholds(bench, data, "seed_by_rule", BY_RULE)
    found = find_thresholds(bench, data, "seed_found")
    return {"seed": seed, "apal": ate_of(bench, data, "apal", found, ALL_LOOPS), "fpfl": ate_of(bench, data, "fpfl", found),
            "by_rule": ate_of(bench, data, "fpfl", by_rule, AS_PUBLISHED)}


def study_seeds(bench: Bench, keep: Keep) -> None:
    def measure() -> None:
        seeds = range(1, 1 + (FEW if bench.quick else SEEDS))
        keep({"name": "ellipse3d", "runs": [measure_seed(bench, seed) for seed in seeds]})

    attempt("compact, seeds: ellipse3d", measure)


# Tables


def spread(values: list[float]) -> list[str]:
    """Median, its 95 % interval, the middle half, and the ends."""
    low, high = median_interval(values)
    return [times(median(values)), f"{digits(low)} … {digits(high)}",
            f"{digits(percentile(values, 0.25))} … {digits(percentile(values, 0.75))}",
            f"{digits(min(values))} … {digits(max(values))}"]


def sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        runs = items(entry, "runs")
        paper = {who: said("ila2017_errors", "ate.translation", graph=text(entry, "name"), strategy=who) for who in ["APAL", "FPFL"]}
        papers_ratio = ratio(paper["FPFL"], paper["APAL"])
        apal = [number(run, "apal.ate") for run in runs]
        some = [["APAL", str(len(runs)), digits(median(apal)), digits(paper["APAL"]), "", "", "", "", "", ""]]
        for name in ["by_rule", "fpfl"]:
            errors = [number(run, f"{name}.ate") for run in runs]
            ratios = [ratio(error, all_loops) for error, all_loops in zip(errors, apal)]
            published = name == "by_rule"
            some.append([TITLES[name], str(len(runs)), digits(median(errors)), digits(paper["FPFL"]) if published else "",
                         *spread(ratios), times(papers_ratio) if published else "",
                         percent(ratio(sum(one <= papers_ratio for one in ratios), len(ratios))) if published else ""])
        rows += named_once(some, text(entry, "name"))
    return {"compact-seeds": table(["graph", "strategy", "draws", "ATE [m]: median", "ATE [m]: the paper's", "over APAL's: median",
                                    "95 % of the median", "middle half", "least … most", "over APAL's: the paper's",
                                    "draws up to it"], rows)}


STUDIES = [Study("compact_seeds", study_seeds, sections)]
