# SPDX-License-Identifier: BSD-3-Clause
"""Every linear solver on offer, to convergence, with a limit of time."""
from __future__ import annotations

import math

from ..averages import median, ratio
from ..data_sets import DataSet, sets_of
from ..pages import Sections, table
from ..program import Run
from ..reports import Json, items, member, number, text
from ..study import Bench, Keep, Study, tell
from ..words import apart, count, megabytes, milliseconds, times, whole

# Runs shorter than this are repeated: their times vary more, and cost less.
SHORT, REPEATS = 5.0, 3

# What is worth trying of a name besides its defaults. A name that is not here is run with those.
VARIANTS = {
    "block_cholesky": ["ordering=amd"],
    "cholmod": ["mode=simplicial", "mode=supernodal", "mode=supernodal,ordering=metis", "mode=supernodal,ordering=nesdis"],
    "pcg": ["preconditioner=block_jacobi", "preconditioner=incomplete_cholesky", "preconditioner=subgraph"],
    "schur": ["linear_solver=cholmod", "linear_solver=pcg"],
    "spqr": ["ordering=metis"],
}
OF_CERES = ["sparse_normal_cholesky", "sparse_schur", "dense_schur", "iterative_schur", "cgnr", "dense_normal_cholesky",
            "dense_qr"]
Way = tuple[str, str]  # an option of `cairn optimize` and its value


def all_ways(bench: Bench) -> list[Way]:
    """Cairn's own first: it is what the others are compared with."""
    specs = []
    for name in bench.cairn.names("linear_solver"):
        # Where all of its choices are spelled out, the default is one of them.
        specs += [] if name == "pcg" else [name]
        specs += bench.cairn.accepted("--linear-solver", [f"{name}:{options}" for options in VARIANTS.get(name, [])])
    ceres = bench.cairn.accepted("--optimizer", [f"ceres:linear_solver_type={type_}" for type_ in OF_CERES])
    return ([("--linear-solver", bench.ours)] + [("--linear-solver", spec) for spec in specs if spec != bench.ours]
            + [("--optimizer", spec) for spec in ceres])


def result_of(run: Run, data: DataSet, limit: float) -> str:
    """How it ended; a complaint without the folder in which the graph lies here."""
    if not run.outcome.in_time:
        return f"not finished after {limit:.0f} s"
    if run.report is not None:
        return text(run.report, "status")
    complaint = run.outcome.complaint.removeprefix("cairn: ").replace(data.graph, data.name, 1)
    return complaint or "stopped by a signal"


def measure(bench: Bench, data: DataSet, way: Way, limit: float) -> Json:
    entry: Json = {"name": data.name, "setting": way[1]}
    seconds: list[float] = []
    for _ in range(1 if bench.quick else REPEATS):
        run = bench.cairn.optimize(data, list(way), 1, limit)
        entry["result"] = result_of(run, data, limit)
        entry["finished"] = run.outcome.in_time and run.report is not None
        if run.report is None:
            break
        seconds.append(number(run.report, "seconds.total"))
        entry.update({name: run.report[name] for name in ["graph", "chi2", "solver", "peak_memory_bytes"]})
        entry["iterations"] = len(items(run.report, "iterations"))
        if seconds[-1] >= SHORT:
            break
    return {**entry, "seconds": median(seconds)} if seconds else entry


def study_solvers(bench: Bench, keep: Keep) -> None:
    limit = 5.0 if bench.quick else 20.0
    ways = all_ways(bench)
    for data in sets_of("solvers", bench.data, bench.quick):
        for way in ways:
            tell(f"solvers: {data.name}, {way[1]}")
            entry = measure(bench, data, way, limit)
            keep(entry)
            # What cairn's own solver does not even begin, such as a file that this build does not read, the others do not
            # either.
            if "graph" not in entry and way[1] == bench.ours:
                break


# Tables

SAME, ROUNDING = 1e-6, 1e-12  # of chi2; of chi2 at the start: what a sum of squares that goes to zero keeps of it


def row_of(entry: Json, first: Json) -> list[str]:
    """The first is what the others are compared with."""
    reference, rounding = number(first, "chi2.final"), ROUNDING * number(first, "chi2.initial")
    chi2, inner = number(entry, "chi2.final"), number(entry, "solver.iterations")
    elsewhere = member(entry, "finished") is True and ratio(abs(chi2 - reference), max(reference, rounding)) > SAME
    return [f"`{text(entry, 'setting')}`", f"{chi2:.8g}" if math.isfinite(chi2) else "-", apart(chi2, reference, rounding),
            whole(number(entry, "iterations")) if math.isfinite(chi2) else "-", count(inner) if math.isfinite(inner) else "",
            milliseconds(number(entry, "seconds")), times(ratio(number(entry, "seconds"), number(first, "seconds"))),
            megabytes(number(entry, "peak_memory_bytes")),
            text(entry, "result") + (", **another chi2**" if elsewhere else "")]


def solvers_sections(entries: list[Json]) -> Sections:
    """A table a graph, in the order in which they were measured."""
    tables = []
    for name in dict.fromkeys(text(entry, "name") for entry in entries):
        some = [entry for entry in entries if text(entry, "name") == name]
        first = some[0]
        if member(first, "graph") is None:
            tables.append(f"**{name}**: {text(first, 'result')}\n")
            continue
        title = (f"**{name}** ({number(first, 'graph.variables'):.0f} variables, "
                 f"{number(first, 'graph.factors'):.0f} factors)\n\n")
        tables.append(title + table(["solver", "chi2", "apart", "iterations", "inner iterations", "time [ms]",
                                     "against the first", "peak memory [MB]", "result"],
                                    [row_of(entry, first) for entry in some]))
    return {"solvers": "\n".join(tables)}


STUDIES = [Study("solvers", study_solvers, solvers_sections)]
