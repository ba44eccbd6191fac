# SPDX-License-Identifier: BSD-3-Clause
"""How near the factorisation comes to what the machine can do: the rate of dgemm, and the memory's bandwidth."""
from __future__ import annotations

import math

from ..averages import median
from ..data_sets import DataSet, sets_of
from ..pages import Sections, table
from ..program import Settings
from ..reports import Json, items, member, number, text
from ..study import Bench, Keep, Study, for_each_set
from ..words import count, digits, milliseconds, percent
from .graphs import TEN_ITERATIONS


def study_rates(bench: Bench, keep: Keep) -> None:
    def measure(data: DataSet) -> None:
        # Measured again beside every graph: a virtual machine's speed drifts.
        before = bench.cairn.native("cairn_dense_rates", []).report
        report = bench.cairn.bench(data, Settings([bench.ours]), 1, bench.rounds, [*TEN_ITERATIONS, "--no-memory"])
        after = bench.cairn.native("cairn_dense_rates", []).report
        ours = items(items(report, "graphs")[0], "configurations")[0]
        dgemm = [rate for rate in (member(rates, "dgemm") for rates in [before, after]) if rate]
        keep({"name": data.name, "solver": ours["solver"],
              "factorize": median([number(run, "seconds.factorize") / number(run, "iterations")
                                   for run in items(ours, "runs")]),
              "dgemm": max(dgemm, default=None), "bandwidth": after["bandwidth"]})

    for_each_set("rates", sets_of("rates", bench.data, bench.quick), measure)


def flops_per_byte(entry: Json) -> float:
    """Every entry of L is written once and read once: what must cross the bus if L does not stay in a cache, so a lower bound
    of the traffic and an upper bound of the intensity."""
    return number(entry, "solver.factor_flops") / (2.0 * 8.0 * number(entry, "solver.factor_nonzeros"))


def rates_sections(entries: list[Json]) -> Sections:
    dgemm, bandwidth = (median([v for v in (number(entry, of) for entry in entries) if math.isfinite(v)])
                        for of in ["dgemm", "bandwidth"])
    lines = (f"`dgemm` (n = 1024): {digits(1e-9 * dgemm)} GFLOP/s; triad: {digits(1e-9 * bandwidth)} GB/s.\n\n"
             if math.isfinite(dgemm) else
             f"No OpenBLAS to open here, so no `dgemm`; triad: {digits(1e-9 * bandwidth)} GB/s.\n\n")
    rows = []
    for entry in entries:
        rate = number(entry, "solver.factor_flops") / number(entry, "factorize")
        peak, intensity = number(entry, "dgemm"), flops_per_byte(entry)
        roof = min(peak, intensity * number(entry, "bandwidth"))
        rows.append([text(entry, "name"), text(entry, "solver.ordering"), count(number(entry, "solver.factor_nonzeros")),
                     count(number(entry, "solver.factor_flops")), milliseconds(number(entry, "factorize")), digits(1e-9 * rate),
                     percent(rate / peak), digits(intensity), digits(1e-9 * roof), percent(rate / roof)])
    return {"rates": lines + table(["graph", "ordering", "nonzeros of L", "flops", "factorise [ms]", "GFLOP/s", "of `dgemm`",
                                    "flops per byte", "roof [GFLOP/s]", "of the roof"], rows)}


STUDIES = [Study("rates", study_rates, rates_sections)]
