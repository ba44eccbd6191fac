# SPDX-License-Identifier: BSD-3-Clause
"""Sparsification that keeps all poses: a part of the loop closures, chosen in several ways."""
from __future__ import annotations

from collections.abc import Callable

from ...averages import ratio
from ...data_sets import DataSet, edge_sets
from ...pages import Sections, table
from ...reports import Json, contestant, median_of, text
from ...rounds import Contestant
from ...study import Bench, Keep, Study, for_each_set
from ...words import digits, percent, whole
from .runs import measure

# A run is given up after so many seconds; none is repeated, since times are far apart.
LIMIT, ENOUGH = 600.0, 1.0
SEEDS = 5
# Contestants, and what the columns are called.
SELECTIONS = {"mac": "`mac`", "greedy_tree": "`greedy_tree`", "greedy_gain": "`greedy_gain`",
              "divergence": "`objective=divergence`", "l1": "`l1`", "random": "`random`"}


def choosing(name: str, selection: str) -> Contestant:
    return Contestant(name, ["--edges", selection], LIMIT, ENOUGH)


def measure_edges(bench: Bench, data: DataSet, part: str) -> Json:
    # Random choices are repeated with other seeds: the runs of one contestant.
    random = Contestant("random", limit=LIMIT)
    for seed in range(1, SEEDS + 1):
        one = choosing("random", f"random:part={part},seed={seed}")
        measure(bench, data, [one], 1)
        random.runs += one.runs
    contestants = [choosing(name, f"{name}:part={part}") for name in ["mac", "greedy_tree", "greedy_gain", "l1"]]
    contestants.append(choosing("divergence", f"greedy_gain:part={part},objective=divergence"))
    entry = measure(bench, data, contestants, 1)
    return {"name": data.name, "part": part, "contestants": [*entry["contestants"], random.entry()]}


def study_edges(bench: Bench, keep: Keep) -> None:
    def measure_set(data: DataSet) -> None:
        for part in ["0.1", "0.25", "0.5"]:
            keep(measure_edges(bench, data, part))

    for_each_set("sparsify, edges", edge_sets(bench.data, bench.quick), measure_set)


# Tables


def table_of(entries: list[Json], cell: Callable[[Json], str], bound: Callable[[Json], str] | None = None) -> str:
    """One row per graph and part; one cell per selection, and before these what `bound` makes of the entry."""
    rows, before = [], ""
    for entry in entries:
        graph, any_one = text(entry, "name"), contestant(entry, "mac")
        rows.append(["" if graph == before else graph,
                     f"{whole(median_of(any_one, 'loops.kept'))} of {whole(median_of(any_one, 'loops.in'))}",
                     *([bound(entry)] if bound else []), *(cell(contestant(entry, name)) for name in SELECTIONS)])
        before = graph
    return table(["graph", "loop closures", *(["bound"] if bound else []), *SELECTIONS.values()], rows)


def sections(entries: list[Json]) -> Sections:
    def number_of(path: str) -> Callable[[Json], str]:
        return lambda c: digits(median_of(c, path))

    def connectivity(of: str) -> Callable[[Json], str]:
        return lambda c: percent(ratio(median_of(c, f"connectivity.rotation.{of}"), median_of(c, "connectivity.rotation.full")))

    return {"sparsify-edges-kld": table_of(entries, number_of("kld"), lambda e: number_of("kld_bound")(contestant(e, "l1"))),
            "sparsify-edges-rmse": table_of(entries, number_of("rmse_aligned")),
            "sparsify-edges-connectivity": table_of(entries, connectivity("sparse"),
                                                    lambda e: connectivity("bound")(contestant(e, "mac"))),
            "sparsify-edges-time": table_of(entries, number_of("seconds.select"))}


STUDIES = [Study("sparsify_edges", study_edges, sections)]
