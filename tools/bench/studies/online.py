# SPDX-License-Identifier: BSD-3-Clause
"""Graphs as they came about, pose by pose: the incremental estimator against those in batch, with covariances and with a
limit of time; the time of each step, and what chi2 is worth."""
from __future__ import annotations

import json
import math

import pandas as pd

from ..averages import ratio
from ..data_sets import DataSet, budget_sets, online_sets
from ..pages import Sections, table
from ..program import Run, Words
from ..reports import NONE, Json, contestant, items, median_of, number, paired_ratio, parts, text
from ..rounds import Contestant, entries_of, run_rounds
from ..study import Bench, Keep, Study, for_each_set
from ..words import count, digits, megabytes, milliseconds, percent, step_times, times, total

OURS, PERIODIC, BATCH = "incremental_cholesky", "periodic_batch", "batch"
# A replay is given up after so many seconds; `batch`, which takes the square of it, sooner, and is not even tried on more
# variables.
LIMIT, LIMIT_OF_BATCH, MOST_VARIABLES_OF_BATCH = 300.0, 60.0, 4000
BUDGET = 0.005  # [s]


def replay(bench: Bench, data: DataSet, arguments: Words, limit: float = 0.0) -> Run:
    return bench.cairn.on("replay", data, arguments, 1, limit).required()


def summary(report: Json) -> Json:
    """What the tables want of a run."""
    names = ["steps", "seconds", "owed", "failed_updates", "marginals_by", "checks", "peak_memory_bytes"]
    return {**{name: report[name] for name in names}, "chi2": report["chi2"]["final"]}


def measure(bench: Bench, part: str, data: DataSet, contestants: list[Contestant]) -> Json:
    run_rounds(bench.rounds_of_runs, contestants, lambda c: replay(bench, data, c.arguments, c.limit), summary)
    return {"part": part, "name": data.name, "generated": data.generated, "contestants": entries_of(contestants)}


def by(estimator: str, *more: str) -> Words:
    return [*more, "--estimator", estimator]


def measure_times(bench: Bench, data: DataSet) -> Json:
    # Apart from the clock: what is optimised at the samples disturbs the caches.
    check = replay(bench, data, by(OURS, "--check", "10" if bench.quick else "50", "--finish")).report
    contestants = [Contestant(OURS, by(OURS), LIMIT), Contestant(PERIODIC, by(PERIODIC), LIMIT)]
    if number(check, "graph.variables") <= MOST_VARIABLES_OF_BATCH:
        contestants.append(Contestant(BATCH, by(BATCH), 10.0 if bench.quick else LIMIT_OF_BATCH))
    return {**measure(bench, "times", data, contestants), "graph": check["graph"], "checks": check["checks"]}


def measure_marginals(bench: Bench, data: DataSet) -> Json:
    """With the estimate and all diagonal blocks."""
    arguments = by(OURS, "--marginals", "diagonal", "--estimate")
    return measure(bench, "marginals", data, [Contestant(OURS, arguments, LIMIT)])


def measure_budget(bench: Bench, data: DataSet) -> Json:
    """`--check 1` compares after the last step, which disturbs nothing."""
    check = ["--check", "1"]
    contestants = [Contestant("none", by(OURS, *check), LIMIT),
                   Contestant("budget", by(OURS, *check, "--budget", str(BUDGET)), LIMIT)]
    return {**measure(bench, "budget", data, contestants), "budget": BUDGET}


def measure_steps(bench: Bench, data: DataSet, setting: str, arguments: Words) -> Json:
    """A point for so many steps, the longest of them, so that the picture stays small."""
    points = 250
    file = bench.cairn.work / "steps.csv"
    replay(bench, data, [*arguments, "--steps", str(file)])
    seconds = pd.read_csv(file).iloc[:, 3].to_numpy()
    every = max(1, len(seconds) // points)
    longest = seconds[:len(seconds) // every * every].reshape(-1, every).max(axis=1)
    return {"part": "steps", "name": data.name, "setting": setting, "every": every, "longest": longest.tolist()}


def study_online(bench: Bench, keep: Keep) -> None:
    sets, limited = online_sets(bench.data, bench.quick), budget_sets(bench.data, bench.quick)
    for_each_set("online", sets, lambda data: keep(measure_times(bench, data)))
    for_each_set("online, covariances", sets, lambda data: keep(measure_marginals(bench, data)))
    for_each_set("online, budget", limited, lambda data: keep(measure_budget(bench, data)))

    def steps(data: DataSet, settings: dict[str, Words]) -> None:
        for setting, arguments in settings.items():
            keep(measure_steps(bench, data, setting, arguments))

    for_each_set("online, steps", sets[:1], lambda data: steps(data, {name: by(name) for name in [OURS, PERIODIC]}))
    # In the picture a large map, whose loops cost most.
    for_each_set("online, steps", [one for one in limited if one.name.startswith("city")][:1], lambda data: steps(
        data, {OURS: by(OURS), f"at most {1e3 * BUDGET:.0f} ms": by(OURS, "--budget", str(BUDGET))}))


# Tables


def ours(entry: Json) -> Json:
    return contestant(entry, OURS)


def above(excess: float) -> str:
    """"0.012 %" of 0.00012; never "-0.000"."""
    percents = 100.0 * excess
    if percents >= 99.5:
        return percent(excess)
    return percent(0.0 if abs(percents) < 5e-4 else excess, 3)


def best(check: Json) -> float:
    """The lower of what batch reaches from a fresh guess and from the estimate at hand."""
    return min(number(check, "batch"), number(check, "polished"))


def last_check(entry: Json) -> Json:
    """None if there is none."""
    return next(reversed(items(entry, "checks")), None)


def final_excess(contestant: Json, check: Json) -> float:
    """By how much the final chi2 of a contestant is above the best that is known."""
    return ratio(median_of(contestant, "chi2"), best(check)) - 1.0 if contestant and check else NONE


def worst(entry: Json) -> float:
    """The largest excess at the samples, of which the last is that of the timed runs: the checked run has finished there.
    Before the first loop closes, chi2 is nothing but rounding, whose ratios say nothing."""
    rounding, last = 1e-9, last_check(entry)
    known = [check for check in items(entry, "checks") if best(check) > rounding * best(last)]
    return max([final_excess(ours(entry), last), *(ratio(number(check, "chi2"), best(check)) - 1.0 for check in known)])


def times_table(entries: list[Json]) -> str:
    rows = []
    for entry in parts(entries, "times"):
        mine, periodic, batch = ours(entry), contestant(entry, PERIODIC), contestant(entry, BATCH)
        memory = [megabytes(median_of(c, "peak_memory_bytes")) for c in [mine, periodic]]
        rows.append([text(entry, "name"), f"{median_of(mine, 'steps.count'):.0f}", total(mine), *step_times(mine),
                     total(periodic), times(paired_ratio(periodic, mine)), milliseconds(median_of(periodic, "steps.max")),
                     total(batch), times(paired_ratio(batch, mine)), " / ".join(memory)])
    return table(["graph", "steps", "ours [s]", "median step [ms]", "95 %", "99 %", "longest", "`periodic_batch` [s]",
                  "`periodic_batch` / ours", "`periodic_batch`: longest step [ms]", "`batch` [s]", "`batch` / ours",
                  "peak memory [MB]"], rows)


def chi2_table(entries: list[Json]) -> str:
    rows = []
    for entry in parts(entries, "times"):
        if check := last_check(entry):
            rows.append([text(entry, "name"), f"{median_of(ours(entry), 'chi2'):.8g}", f"{number(check, 'batch'):.8g}",
                         f"{number(check, 'polished'):.8g}", above(final_excess(ours(entry), check)), above(worst(entry)),
                         above(ratio(number(check, "chi2"), best(check)) - 1.0),
                         above(final_excess(contestant(entry, PERIODIC), check))])
    return table(["graph", "chi2", "batch, from the initial estimate", "batch, from the estimate", "above batch",
                  "at most, at the samples", "finished", "`periodic_batch` above batch"], rows)


def marginals_table(entries: list[Json]) -> str:
    plain = {text(entry, "name"): entry for entry in reversed(parts(entries, "times"))}
    rows = []
    for entry in parts(entries, "marginals"):
        mine, name = ours(entry), text(entry, "name")
        by_way = [median_of(mine, f"marginals_by.{way}") for way in ["downdate", "recomputation", "unchanged"]]
        rows.append([name, f"{median_of(mine, 'steps.count'):.0f}", total(mine),
                     total(ours(plain[name])) if name in plain else "-",
                     percent(median_of(mine, "seconds.marginals") / median_of(mine, "seconds.total")), *step_times(mine),
                     *(f"{steps:.0f}" if math.isfinite(steps) else "0" for steps in by_way),
                     megabytes(median_of(mine, "peak_memory_bytes"))])
    return table(["graph", "steps", "all [s]", "without [s]", "covariances", "median step [ms]", "95 %", "99 %", "longest",
                  "downdated", "recomputed", "unchanged", "peak memory [MB]"], rows)


def budget_table(entries: list[Json]) -> str:
    rows = []
    for entry in parts(entries, "budget"):
        # All of them go for the same minimum: the best of it is what they are compared with.
        checks = [last_check(run) for c in items(entry, "contestants") for run in items(c, "runs")]
        lowest = min((best(check) for check in checks if check), default=math.inf)
        for c in items(entry, "contestants"):
            chi2 = median_of(c, "chi2")
            limit = digits(1e3 * number(entry, "budget")) if text(c, "name") == "budget" else "none"
            rows.append([text(entry, "name"), limit, total(c), *step_times(c), f"{chi2:.8g}", above(ratio(chi2, lowest) - 1.0),
                         count(median_of(c, "owed"))])
    return table(["graph", "limit [ms]", "all [s]", "median step [ms]", "95 %", "99 %", "longest", "chi2", "above batch",
                  "deferred at the end"], rows)


def online_sections(entries: list[Json]) -> Sections:
    return {"online-times": times_table(entries), "online-chi2": chi2_table(entries),
            "online-marginals": marginals_table(entries), "online-budget": budget_table(entries)}


def online_picture(entries: list[Json]) -> dict[str, str]:
    """The time of the steps of replays, a point at every so many steps."""
    graphs: list[Json] = []
    for entry in parts(entries, "steps"):
        name, every = text(entry, "name"), int(number(entry, "every"))
        if not graphs or graphs[-1]["graph"]["file"] != name:
            graphs.append({"graph": {"file": name}, "configurations": []})
        nothing = {"chi2": None, "seconds": None}
        history = [point for value in items(entry, "longest")
                   for point in [*[nothing] * (every - 1), {"chi2": None, "seconds": value}]]
        graphs[-1]["configurations"].append({"optimizer": f"{text(entry, 'setting')}, longest of {every}",
                                             "linear_solver": "-", "history": history})
    return {"online_picture.json": json.dumps({"command": "bench", "graphs": graphs}) + "\n"}


STUDIES = [Study("online", study_online, online_sections, online_picture)]
