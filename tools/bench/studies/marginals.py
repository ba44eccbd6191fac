# SPDX-License-Identifier: BSD-3-Clause
"""How long covariances take, beyond the factorisation that they need: all diagonal blocks and the last block column, by
cairn's own recursion with one thread and with two, and on small graphs by solves with `cholmod`."""
from __future__ import annotations

from ..averages import median
from ..data_sets import DataSet, sets_of
from ..pages import Sections, table
from ..program import Words
from ..reports import Json, number, text
from ..study import Bench, Keep, Study, for_each_set
from ..words import count, milliseconds, times

# Solves for every column take seconds beyond so many variables; they are measured up to here.
MOST_SOLVED = 2000


def measure(bench: Bench, data: DataSet, solver: str, asked: Words, threads: int = 1) -> Json:
    """Medians over fresh processes, so that no page of memory is there already, and the last report."""
    reports = [bench.cairn.on("marginals", data, ["--as-given", *asked, "--linear-solver", solver], threads).required().report
               for _ in range(bench.rounds)]
    return {"report": reports[-1],
            **{of: median([number(report, f"seconds.{of}") for report in reports]) for of in ["factorize", "marginals"]}}


def study_marginals(bench: Bench, keep: Keep) -> None:
    solved = bool(bench.cairn.accepted("--linear-solver", ["cholmod"]))
    diagonal, column = ["--diagonal"], ["--column", "last"]

    def measure_set(data: DataSet) -> None:
        one = measure(bench, data, bench.ours, [*diagonal, *column])
        small = number(one, "report.graph.variables") <= MOST_SOLVED
        keep({"name": data.name, "graph": one["report"]["graph"], "solver": one["report"]["solver"],
              "factorize": one["factorize"], "both": one["marginals"],
              "diagonal": measure(bench, data, bench.ours, diagonal)["marginals"],
              "column": measure(bench, data, bench.ours, column)["marginals"],
              "two_threads": measure(bench, data, bench.ours, [*diagonal, *column], 2)["marginals"],
              "solves": measure(bench, data, "cholmod", [*diagonal, *column])["marginals"] if solved and small else None})

    for_each_set("marginals", sets_of("marginals", bench.data, bench.quick), measure_set)


def marginals_sections(entries: list[Json]) -> Sections:
    rows = [[text(entry, "name"), f"{number(entry, 'graph.variables'):.0f}", count(number(entry, "solver.factor_nonzeros")),
             *(milliseconds(number(entry, of)) for of in ["factorize", "diagonal", "column", "both", "two_threads", "solves"]),
             times(number(entry, "solves") / number(entry, "both"))] for entry in entries]
    return {"marginals": table(["graph", "variables", "nonzeros of L", "analyse, factorise [ms]", "diagonal [ms]",
                                "last column [ms]", "both [ms]", "both, 2 threads [ms]", "both by `cholmod`'s solves [ms]",
                                "faster"], rows)}


STUDIES = [Study("marginals", study_marginals, marginals_sections)]
