# SPDX-License-Identifier: BSD-3-Clause
"""The main comparison: ten Gauss-Newton iterations by cairn's own solver, by the best setting of `cholmod` and by the best
of `ceres`, with one thread, then with two; and one thread against two."""
from __future__ import annotations

import json
import math
from collections.abc import Callable

from ..averages import geometric_mean, median
from ..data_sets import DataSet, sets_of
from ..pages import Sections, table
from ..program import Settings, Words
from ..reports import NONE, Json, items, member, number, text
from ..study import Bench, Keep, Study, for_each_set, tell
from ..words import apart, count, megabytes, milliseconds, times

ITERATIONS = 10  # asked of each
TEN_ITERATIONS = ["--iterations", str(ITERATIONS), "--tolerance", "0"]
# Settings that were this much slower than the best of their family when scouting are not measured.
NEARLY_BEST, MOST_OF_A_FAMILY = 1.25, 2


def all_settings(bench: Bench) -> Settings:
    """Ceres has no Gauss-Newton: its Levenberg-Marquardt with next to no damping is that, except that it refuses steps that
    raise chi2."""
    cholmod = [f"cholmod:mode={mode},ordering={ordering}"
               for mode in ["simplicial", "supernodal"] for ordering in ["amd", "metis", "nesdis"]]
    ceres = [f"ceres:sparse_library={library},initial_radius=1e16"
             for library in ["suite_sparse", "cx_sparse", "eigen_sparse"]]
    return Settings(bench.cairn.accepted("--linear-solver", [bench.ours, *cholmod]), bench.cairn.accepted("--optimizer", ceres))


def spec_of(configuration: Json) -> str:
    """A configuration as it was asked for."""
    return text(configuration, "optimizer" if is_ceres(configuration) else "linear_solver")


def nearly_best(scouted: Json, settings: Settings) -> Settings:
    """One round over all settings shows which of each family are worth measuring."""
    families: dict[str, list[tuple[float, str]]] = {}
    ours = settings.linear_solvers[0]
    for c in items(scouted, "configurations"):
        spec = spec_of(c)
        if math.isfinite(per_iteration(c)) and spec != ours:
            families.setdefault(spec.partition(":")[0], []).append((per_iteration(c), spec))
    chosen = Settings([ours])  # first: it is what the others are compared with
    for family, measured in sorted(families.items()):
        best = min(measured)[0]
        specs = [spec for seconds, spec in sorted(measured)[:MOST_OF_A_FAMILY] if seconds <= NEARLY_BEST * best]
        (chosen.complete if family == "ceres" else chosen.linear_solvers).extend(specs)
    return chosen


def scouting_notes(scouted: Json) -> list[Json]:
    return [{"setting": spec_of(c), "seconds_per_iteration": member(c, "seconds.per_iteration"), "error": text(c, "error")}
            for c in items(scouted, "configurations")]


def measure_graph(bench: Bench, data: DataSet, settings: Settings, threads: int) -> Json:
    tell(f"  scouting, threads: {threads}")
    scouted = items(bench.cairn.bench(data, settings, threads, 1, [*TEN_ITERATIONS, "--no-memory"]), "graphs")[0]
    tell(f"  measuring, threads: {threads}")
    report = bench.cairn.bench(data, nearly_best(scouted, settings), threads, bench.rounds, TEN_ITERATIONS)
    return {"name": data.name, "generated": data.generated, "threads": threads, "machine": report["machine"],
            "build": report["build"], "scouted": scouting_notes(scouted), "measured": items(report, "graphs")[0]}


def study_graphs(bench: Bench, keep: Keep) -> None:
    settings = all_settings(bench)

    def measure(data: DataSet) -> None:
        for threads in [1, 2]:
            keep(measure_graph(bench, data, settings, threads))

    for_each_set("graphs", sets_of("graphs", bench.data, bench.quick), measure)


def study_threads(bench: Bench, keep: Keep) -> None:
    runs_of_a_process = 2  # the first is colder
    arguments: Words = [*TEN_ITERATIONS, "--no-memory"]

    def measure(data: DataSet) -> None:
        samples: dict[int, dict[str, list[float]]] = {n: {"iteration": [], "factorize": []} for n in [1, 2]}
        # In turn, so that what the machine does besides meets both alike.
        for _ in range(bench.rounds):
            for threads, sample in samples.items():
                report = bench.cairn.bench(data, Settings([bench.ours]), threads, runs_of_a_process, arguments)
                for run in items(items(items(report, "graphs")[0], "configurations")[0], "runs"):
                    iterations = number(run, "iterations")
                    sample["iteration"].append(number(run, "seconds.total") / iterations)
                    sample["factorize"].append(number(run, "seconds.factorize") / iterations)
        one, two = ({name: median(values) for name, values in sample.items()} for sample in samples.values())
        keep({"name": data.name, "one": one, "two": two})

    for_each_set("threads", sets_of("threads", bench.data, bench.quick), measure)


# Tables


def is_ceres(configuration: Json) -> bool:
    return text(configuration, "optimizer").startswith("ceres")


def is_cholmod(configuration: Json) -> bool:
    return text(configuration, "linear_solver").startswith("cholmod")


def per_iteration(configuration: Json) -> float:
    return number(configuration, "seconds.per_iteration")


def ours_of(entry: Json) -> Json:
    return items(entry, "measured.configurations")[0]


def best(entry: Json, belongs: Callable[[Json], bool]) -> Json:
    """The fastest configuration of a family; None if none ran."""
    family = [c for c in items(entry, "measured.configurations") if belongs(c) and math.isfinite(per_iteration(c))]
    return min(family, key=per_iteration, default=None)


def ratio_of_iterations(peer: Json, ours: Json) -> float:
    """The median over the rounds of the ratio of the time of an iteration."""
    def seconds(run: Json) -> float:
        return number(run, "seconds.total") / number(run, "iterations")
    return median([seconds(a) / seconds(b) for a, b in zip(items(peer, "runs"), items(ours, "runs"))])


def setting(configuration: Json) -> str:
    """"mode=supernodal,ordering=amd" as "supernodal, amd"; Ceres' radius is the same everywhere."""
    options = spec_of(configuration).partition(":")[2].split(",")
    return ", ".join(option.partition("=")[2] for option in options if not option.startswith("initial_radius"))


def steps_refused(configuration: Json) -> str:
    """Ceres does not take steps that raise chi2, and does not linearise again then."""
    history = items(configuration, "history")
    taken = sum(member(step, "accepted") is True for step in history)
    return "" if taken == ITERATIONS else f"; {taken} of {len(history)} steps taken"


def comparison(entries: list[Json], threads: int) -> str:
    rows = []
    for generated in [False, True]:
        ratios: dict[str, list[float]] = {"cholmod": [], "ceres": []}
        for entry in entries:
            if number(entry, "threads") != threads or (member(entry, "generated") is True) != generated:
                continue
            ours = ours_of(entry)
            peers = {"cholmod": best(entry, is_cholmod), "ceres": best(entry, is_ceres)}
            row = [text(entry, "name"), f"{number(entry, 'measured.graph.variables'):.0f}",
                   f"{number(entry, 'measured.graph.factors'):.0f}", milliseconds(per_iteration(ours))]
            for name, peer in peers.items():
                ratio = ratio_of_iterations(peer, ours) if peer else NONE
                if math.isfinite(ratio):
                    ratios[name].append(ratio)
                row += [f"{milliseconds(per_iteration(peer))} ({setting(peer)}{steps_refused(peer)})" if peer else "-",
                        times(ratio)]
            chi2 = number(ours, "chi2.final")
            row += [apart(number(peer, "chi2.final"), chi2) for peer in peers.values()]
            row.append(" / ".join(megabytes(number(c, "peak_memory_bytes")) for c in [ours, *peers.values()]))
            rows.append(row)
        if any(ratios.values()):
            means = [f"**{times(geometric_mean(some))}**" if some else "-" for some in ratios.values()]
            name = "generated" if generated else "published"
            rows.append([f"**{name}, geometric mean**", "", "", "", "", means[0], "", means[1], "", "", ""])
    return table(["graph", "variables", "factors", "ours [ms]", "best `cholmod` [ms]", "`cholmod` / ours", "best `ceres` [ms]",
                  "`ceres` / ours", "chi2 apart: `cholmod`", "chi2 apart: `ceres`", "peak memory [MB]"], rows)


def time_parts(entries: list[Json]) -> str:
    """Where an iteration's time goes, with one thread."""
    rows = []
    for entry in entries:
        if number(entry, "threads") != 1:
            continue
        ours = ours_of(entry)
        row = [text(entry, "name")]
        for part in ["linearize", "factorize", "solve", "update", "analyze"]:
            row.append(milliseconds(median([
                number(run, f"seconds.{part}") / (1.0 if part == "analyze" else number(run, "iterations"))
                for run in items(ours, "runs")])))
        rows.append([*row, count(number(ours, "solver.factor_nonzeros")), count(number(ours, "solver.factor_flops")),
                     text(ours, "solver.ordering")])
    return table(["graph", "linearise [ms]", "factorise", "solve", "update", "analyse, once", "nonzeros of L", "flops",
                  "ordering"], rows)


def graphs_sections(entries: list[Json]) -> Sections:
    return {"graphs-1": comparison(entries, 1), "graphs-2": comparison(entries, 2), "parts": time_parts(entries)}


def graphs_picture(entries: list[Json]) -> dict[str, str]:
    """The best of each family alone, as bars, in the words of `cairn bench --json`; of ten iterations, though Ceres may have
    ended before."""
    graphs = []
    for entry in entries:
        if number(entry, "threads") != 1:
            continue
        families = {"block_cholesky": ours_of(entry), "cholmod": best(entry, is_cholmod), "ceres": best(entry, is_ceres)}
        shown = []
        for family, c in families.items():
            if not c:
                continue
            scale = ITERATIONS * per_iteration(c) / number(c, "seconds.median")
            scaled = {name: scale * number(c, f"seconds.{name}") for name in ["median", "min", "max"]}
            seconds = {**c["seconds"], **(scaled if math.isfinite(scale) else {})}  # else it did not run
            shown.append({**c, "optimizer": family, "linear_solver": "-", "seconds": seconds})
        graphs.append({"graph": {"file": text(entry, "name")}, "configurations": shown})
    return {"graphs_picture.json": json.dumps({"command": "bench", "graphs": graphs}) + "\n"}


def threads_sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        row = [text(entry, "name")]
        for part in ["factorize", "iteration"]:
            one, two = number(entry, f"one.{part}"), number(entry, f"two.{part}")
            row += [milliseconds(one), milliseconds(two), times(one / two)]
        rows.append(row)
    return {"threads": table(["graph", "factorise, 1 thread [ms]", "factorise, 2 threads [ms]", "factorise: faster",
                              "iteration, 1 thread [ms]", "iteration, 2 threads [ms]", "iteration: faster"], rows)}


STUDIES = [Study("graphs", study_graphs, graphs_sections, graphs_picture), Study("threads", study_threads, threads_sections)]
