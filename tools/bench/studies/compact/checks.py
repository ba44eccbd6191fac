# SPDX-License-Identifier: BSD-3-Clause
"""Whether the covariances of compact pose SLAM are true, and what false matches do to it: normalised errors over many runs,
covariances beside those with everything, and a registration of which a tenth is wrong."""
from __future__ import annotations

import math

from ...averages import median, ratio
from ...data_sets import DataSet, compact_sets_named, ellipse3d, simulated_sets
from ...pages import Sections, table
from ...reports import Json, contestant, items, median_of, number, parts, text, was_late
from ...rounds import Contestant, entries_of
from ...study import Bench, Keep, Study, attempt, for_each_set, tell
from ...words import digits, percent, plain, times, whole
from .runs import ALL_LOOPS, TITLES, Thresholds, ate, find_thresholds, named_once, run_compact, run_seeds, summary, tenths, with_truth

LIMIT = 120.0  # of a run [s]
FALSE_RATE, GATE = 0.1, 0.99


def measure_errors(bench: Bench, thresholds: Thresholds, noise: float, strategy: str, keep: int) -> Json:
    """The same drive with other noise each time, and thresholds from yet another; perhaps with so many poses at most."""
    arguments = ["--strategy", strategy, "--thresholds", thresholds.file, "--keep", str(keep)]
    if strategy == "apal":
        arguments += ["--policy", ALL_LOOPS]
    runs = [run_compact(bench, ellipse3d(f",seed={seed}", noise), arguments).report["nees"]
            for seed in range(1, 11 if bench.quick else 101)]
    return {"part": "nees", "name": ellipse3d(noise=noise).name, "strategy": strategy, "keep": keep, "runs": runs}


def measure_comparison(bench: Bench, plain_data: DataSet) -> Json:
    """At every step beside the system with everything."""
    data = with_truth(bench, plain_data)
    thresholds = find_thresholds(bench, data, "found")
    report = run_compact(bench, data, ["--thresholds", thresholds.file, "--compare", str(bench.cairn.work / "compare.csv")]).report
    return {"part": "compare", "name": data.name, "compare": report["compare"], "run": summary(report)}


def study_consistency(bench: Bench, keep: Keep) -> None:
    tell("compact, consistency: normalised errors")
    thresholds = find_thresholds(bench, ellipse3d(",seed=1000"), "found")
    for noise in [1.0, 0.1]:  # by how much the second differs is the error of linearising
        for strategy, most in [("apal", 0), ("fpfl", 0), ("fpfl", 30)]:
            keep(measure_errors(bench, thresholds, noise, strategy, most))
    for_each_set("compact, covariances", compact_sets_named(["ellipse3d", "parking-garage"], bench.data, bench.quick),
                 lambda data: keep(measure_comparison(bench, data)))


def measure_matches(bench: Bench, plain_data: DataSet, sensor: str) -> Json:
    data = with_truth(bench, plain_data)
    registration = f"simulated:{sensor}"
    thresholds = find_thresholds(bench, data, "found", ["--registration", registration])
    cases = []
    for false_rate, rate_name in [(0.0, "clean"), (FALSE_RATE, "false")]:
        for gate_name, gate in {"open": list[str](), "gated": ["--gate", plain(GATE)]}.items():
            case = Contestant(f"{gate_name}, {rate_name}", ["--thresholds", thresholds.file, *gate], LIMIT)
            option = f"{registration},false_rate={plain(false_rate)}"
            cases.append(run_seeds(bench, data, case, 2 if bench.quick else 5, lambda seed, option=option:  # type: ignore[misc]
                                   ["--registration", f"{option},seed={seed}"]))
    return {"name": data.name, "registration": registration, "false_rate": FALSE_RATE, "gate": GATE,
            "thresholds": thresholds.found, "contestants": entries_of(cases)}


def study_matches(bench: Bench, keep: Keep) -> None:
    def measure(data: DataSet, sensor: str) -> None:
        attempt(f"compact, false matches: {data.name}", lambda: keep(measure_matches(bench, data, sensor)))

    for data, sensor in simulated_sets(bench.data, bench.quick):
        measure(data, sensor)


# Tables


def nees_table(entries: list[Json]) -> str:
    two_sided = 1.96  # of a normal distribution, 95 %
    rows = []
    for entry in parts(entries, "nees"):
        known = [run for run in items(entry, "runs") if math.isfinite(number(run, "dof"))]
        dof = sum(number(run, "dof") for run in known)
        mean = ratio(sum(number(run, "squared") for run in known), dof)
        half = two_sided * math.sqrt(ratio(2.0, dof))  # of chi2 / dof, for many DoF
        verdict = "overconfident" if mean > 1.0 + half else "conservative" if mean < 1.0 - half else "consistent"
        strategy, most = TITLES.get(text(entry, "strategy"), text(entry, "strategy")), number(entry, "keep")
        rows.append([text(entry, "name"), strategy + (f", `--keep {most:.0f}`" if most > 0 else ""), str(len(known)), whole(dof), f"{mean:.4f}",
                     f"{1.0 - half:.4f} … {1.0 + half:.4f}", verdict])
    return table(["graph", "strategy", "runs", "DoF in total", "NEES/DoF", "95 % if consistent", "verdict"], rows)


def compare_table(entries: list[Json]) -> str:
    rows = []
    for entry in parts(entries, "compare"):
        of = {name: number(entry, f"compare.{name}") for name in [
            "steps", "marginal_conservative", "least_marginal_ratio", "full_conservative", "least_full_ratio",
            "least_eigenvalue"]}
        least = of["least_eigenvalue"]
        rows.append([text(entry, "name"), whole(of["steps"]), tenths(of["marginal_conservative"]),
                     digits(of["least_marginal_ratio"]), tenths(of["full_conservative"]), digits(of["least_full_ratio"]),
                     f"{least:.3g}" if math.isfinite(least) else "-"])
    return table(["graph", "steps compared", "marginal covariances: not smaller", "marginal covariances: least ratio",
                  "full covariance: not smaller", "full covariance: least ratio", "least eigenvalue"], rows)


def consistency_sections(entries: list[Json]) -> Sections:
    return {"compact-nees": nees_table(entries), "compact-compare": compare_table(entries)}


def verdicts(c: Json, verdict: str) -> str:
    """Of how many links the policy said so, as a median; it names no verdict that it never gave."""
    counts = [number(run, f"verdicts.{verdict}") for run in items(c, "runs")]
    return whole(median([some if math.isfinite(some) else 0.0 for some in counts]))


def matches_sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        clean, some = ate(contestant(entry, "open, clean")), []
        for which in ["open, clean", "gated, clean", "open, false", "gated, false"]:
            c = contestant(entry, which)
            some.append([percent(number(entry, "false_rate")) if which.endswith("false") else "none",
                         plain(number(entry, "gate")) if which.startswith("gated") else "none",
                         f"> {number(c, 'limit'):.0f} s" if was_late(c) else whole(median_of(c, "loops.registered")),
                         *(whole(median_of(c, f"loops.{of}")) for of in ["false_registered", "kept", "false_kept"]),
                         verdicts(c, "inconsistent"), verdicts(c, "waiting"), whole(median_of(c, "poses.kept")), digits(ate(c)),
                         times(ratio(ate(c), clean))])
        rows += named_once(some, text(entry, "name"))
    return {"compact-matches": table(["graph", "false matches", "gate", "registered", "registered, false", "loops kept",
                                      "loops kept, false", "refused", "waiting", "poses kept", "ATE [m]", "over clean"], rows)}


STUDIES = [Study("compact_consistency", study_consistency, consistency_sections),
           Study("compact_matches", study_matches, matches_sections)]
