# SPDX-License-Identifier: BSD-3-Clause
"""Mixed precision beside double: processor time of ten Gauss-Newton iterations, and how far apart the results are."""
from __future__ import annotations

import re

from ..averages import geometric_mean
from ..data_sets import DataSet, sets_of
from ..pages import Sections, table
from ..program import Run, Words
from ..reports import Json, contestant, items, median_of, number, text
from ..rounds import Contestant, entries_of, run_rounds
from ..study import Bench, Keep, Study, for_each_set
from ..words import apart, digits, milliseconds, times
from .graphs import ITERATIONS

WORTHWHILE = 1.3  # times faster, for mixed precision to be the choice
DOUBLE, MIXED, START = "double", "mixed", "start"
ENOUGH = 600.0  # of all rounds of one of them [s]; long, since a busy machine does not spoil the processor's time much


def study_precision(bench: Bench, keep: Keep) -> None:
    separator = "," if ":" in bench.ours else ":"

    def arguments(solver: str, iterations: int) -> Words:
        return ["--optimizer", "gauss_newton", "--linear-solver", solver, "--iterations", str(iterations), "--tolerance", "0"]

    def measure(data: DataSet) -> None:
        # Reading, the initial estimate and the analysis are the same for both: they are taken off.
        contestants = [Contestant(name, arguments(solver, iterations), enough=ENOUGH) for name, solver, iterations in [
            (START, bench.ours, 0), (DOUBLE, bench.ours, ITERATIONS),
            (MIXED, f"{bench.ours}{separator}precision=mixed", ITERATIONS)]]

        def run(one: Contestant) -> Run:
            words = [*one.arguments, *([] if "--initial" in data.arguments else ["--initial", "auto"])]
            done = bench.cairn.optimize(data, words).required()
            done.report.update(processor=done.outcome.processor)
            return done

        def summary(report: Json) -> Json:
            return {of: report[of] for of in ["processor", "chi2", "solver"]}

        run_rounds(bench.rounds, contestants, run, summary)
        keep({"name": data.name, "contestants": entries_of(contestants)})

    for_each_set("precision", sets_of("precision", bench.data, bench.quick), measure)


def iteration(entry: Json, name: str) -> float:
    """Seconds of the processor."""
    start, end = (median_of(contestant(entry, of), "processor") for of in [START, name])
    return (end - start) / ITERATIONS


def refinement(run: Json) -> str:
    """Steps for each solution, or that it fell back."""
    note = text(run, "solver.note")
    found = re.search(r"(\d+) solutions refined in (\d+) steps", note)
    if "then double precision" in note:
        return "falls back"
    return digits(int(found[2]) / int(found[1])) if found and int(found[1]) > 0 else "-"


def precision_sections(entries: list[Json]) -> Sections:
    rows, ratios = [], []
    for entry in entries:
        double, mixed = (items(contestant(entry, of), "runs")[-1] for of in [DOUBLE, MIXED])
        ratio = iteration(entry, DOUBLE) / iteration(entry, MIXED)
        ratios.append(ratio)
        flops = number(double, "solver.factor_flops") / number(double, "solver.factor_nonzeros")
        rows.append([text(entry, "name"), digits(flops), *(milliseconds(iteration(entry, of)) for of in [DOUBLE, MIXED]),
                     f"**{times(ratio)}**" if ratio >= WORTHWHILE else times(ratio), refinement(mixed),
                     apart(number(mixed, "chi2.final"), number(double, "chi2.final"))])
    if ratios:
        rows.append(["**geometric mean**", "", "", "", f"**{times(geometric_mean(ratios))}**", "", ""])
    return {"precision": table(["graph", "flops per nonzero", "double [ms]", "mixed [ms]", "faster", "steps", "chi2 apart"],
                               rows)}


STUDIES = [Study("precision", study_precision, precision_sections)]
