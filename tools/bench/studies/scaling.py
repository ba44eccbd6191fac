# SPDX-License-Identifier: BSD-3-Clause
"""Time and memory against size on generated graphs, and one graph of a million poses to convergence."""
from __future__ import annotations

import json
import math

from ..averages import fitted_exponent, median
from ..data_sets import DataSet
from ..pages import Sections, table
from ..processes import allowed_memory
from ..program import Run, Words
from ..reports import Json, items, number, text
from ..study import Bench, Keep, Study, tell
from ..words import count, digits, megabytes
from .graphs import TEN_ITERATIONS

PATIENCE = 300.0  # of one run [s]
# Assumed until two sizes are known: beyond what any of these families shows.
FIRST_GUESS_OF_GROWTH = 2.0
MILLION = 1_000_000
FAMILIES = ["manhattan", "city", "grid3d"]


def graph_of(family: str, poses: int) -> DataSet:
    side = round(poses ** (1 / 3))
    return DataSet(family, f"@grid3d:nx={side},ny={side},nz={side}" if family == "grid3d" else f"@{family}:poses={poses}")


def rounds_of(poses: int, seconds: float, rounds: int) -> int:
    """Large runs vary little, and take long. `seconds`: what one is expected to take."""
    long = 60.0
    if poses <= 10_000:
        return rounds
    return min(rounds, 3) if poses <= 100_000 and seconds < long else 1


class Forecast:
    """What the next size will take, by the growth between the last two."""

    def __init__(self) -> None:
        self.poses = self.value = 0.0
        self.growth = FIRST_GUESS_OF_GROWTH

    def add(self, poses: float, value: float) -> None:
        if self.poses > 0.0:
            self.growth = max(1.0, math.log(value / self.value) / math.log(poses / self.poses))
        self.poses, self.value = poses, value

    def at(self, poses: float) -> float:
        return self.value * math.pow(poses / self.poses, self.growth) if self.poses > 0.0 else 0.0


def why_left_out(run: Run) -> str:
    if not run.outcome.in_time:
        return f"not finished after {PATIENCE:.0f} s"
    return "failed: " + (run.outcome.complaint or f"killed, at {1e-9 * run.outcome.peak_memory:.1f} GB")


def measure(bench: Bench, family: str, poses: int, arguments: Words, rounds: int) -> Json:
    """The runs' medians, with what is the same in all of them."""
    entry: Json = {"family": family, "poses": poses}
    seconds, memory, whole = [], [], []
    for _ in range(rounds):
        run = bench.cairn.optimize(graph_of(family, poses), arguments, 1, PATIENCE)
        if not run.outcome.in_time or run.report is None:
            return {**entry, "left_out": why_left_out(run)}
        seconds.append(number(run.report, "seconds.total"))
        memory.append(number(run.report, "peak_memory_bytes"))
        whole.append(run.outcome.seconds)
        entry.update({name: run.report[name] for name in ["graph", "solver", "status", "chi2", "initial"]})
        entry["iterations"] = len(items(run.report, "iterations"))
    # The whole process generates the graph and makes the initial estimate, too.
    return {**entry, "rounds": rounds, "seconds": median(seconds), "peak_memory_bytes": median(memory),
            "process_seconds": median(whole)}


def study_family(bench: Bench, family: str, keep: Keep) -> None:
    time, memory = Forecast(), Forecast()
    for poses in [1000, 3000, 10_000, *([] if bench.quick else [30_000, 100_000, 300_000, MILLION])]:
        seconds, size = time.at(poses), memory.at(poses)
        if seconds > PATIENCE or size > allowed_memory():
            tell(f"scaling: {family} of {poses} poses left out")
            keep({"family": family, "poses": poses,
                  "left_out": f"would take about {seconds:.0f} s and {size / 1e9:.0f} GB"})
            continue
        tell(f"scaling: {family} of {poses} poses")
        entry = measure(bench, family, poses,
                        ["--optimizer", "gauss_newton", "--linear-solver", bench.ours, *TEN_ITERATIONS],
                        rounds_of(poses, seconds, bench.rounds))
        if "left_out" not in entry:
            time.add(poses, entry["seconds"])
            memory.add(poses, entry["peak_memory_bytes"])
        keep({**entry, "study": "ten iterations"})


def study_scaling(bench: Bench, keep: Keep) -> None:
    for family in FAMILIES:
        study_family(bench, family, keep)
    family, poses = FAMILIES[0], 10_000 if bench.quick else MILLION
    tell(f"scaling: {family} of {poses} poses, to convergence")
    # From dead reckoning nothing converges over such a distance; the spanning tree costs next to nothing, and its time is in
    # that of the process.
    entry = measure(bench, family, poses, ["--initial", "spanning_tree", "--linear-solver", bench.ours], 1)
    keep({**entry, "study": "convergence"})


# Tables


def of_study(entries: list[Json], study: str) -> list[Json]:
    return [entry for entry in entries if (text(entry, "study") == "convergence") == (study == "convergence")]


def scaling_table(entries: list[Json]) -> str:
    rows = []
    for entry in of_study(entries, "ten iterations"):
        if left_out := text(entry, "left_out"):
            rows.append([text(entry, "family"), count(number(entry, "poses")), "", "", "", "left out: " + left_out, "", "", ""])
            continue
        variables, seconds = number(entry, "graph.variables"), number(entry, "seconds")
        memory = number(entry, "peak_memory_bytes")
        rows.append([text(entry, "family"), f"{variables:.0f}", f"{number(entry, 'graph.factors'):.0f}",
                     text(entry, "solver.ordering"), count(number(entry, "solver.factor_nonzeros")), digits(seconds),
                     digits(1e6 * seconds / number(entry, "iterations") / variables), megabytes(memory),
                     digits(1e-3 * memory / variables)])
    return table(["family", "poses", "factors", "ordering", "nonzeros of L", "ten iterations [s]", "µs per pose and iteration",
                  "peak memory [MB]", "kB per pose"], rows)


def growth_table(entries: list[Json]) -> str:
    smallest_fitted = 10_000
    families: dict[str, list[Json]] = {}
    for entry in of_study(entries, "ten iterations"):
        # By the size asked for: a cube of whole sides is never quite that.
        if not text(entry, "left_out") and number(entry, "poses") >= smallest_fitted:
            families.setdefault(text(entry, "family"), []).append(entry)
    rows = []
    for family, some in sorted(families.items()):
        sizes = [number(entry, "graph.variables") for entry in some]
        laws = [f"n^{fitted_exponent(sizes, [number(entry, of) for entry in some]):.2f}" if len(sizes) > 1 else "-"
                for of in ["seconds", "peak_memory_bytes"]]
        rows.append([family, f"{sizes[0]:.0f} … {sizes[-1]:.0f}", str(len(sizes)), *laws])
    return table(["family", "poses", "sizes", "time grows as", "memory grows as"], rows)


def convergence_table(entries: list[Json]) -> str:
    rows = []
    for entry in of_study(entries, "convergence"):
        if left_out := text(entry, "left_out"):
            rows.append([text(entry, "family"), count(number(entry, "poses")), "", "", "", "", left_out, "", "", ""])
            continue
        rows.append([text(entry, "family"), f"{number(entry, 'graph.variables'):.0f}",
                     f"{number(entry, 'graph.factors'):.0f}", digits(number(entry, "seconds")),
                     digits(number(entry, "process_seconds")), f"{number(entry, 'iterations'):.0f}", text(entry, "status"),
                     f"{number(entry, 'chi2.initial'):.6g}", f"{number(entry, 'chi2.final'):.8g}",
                     megabytes(number(entry, "peak_memory_bytes"))])
    return table(["graph", "poses", "factors", "time [s]", "whole process [s]", "iterations", "status", "chi2 at the start",
                  "chi2 at the end", "peak memory [MB]"], rows)


def scaling_sections(entries: list[Json]) -> Sections:
    return {"scaling": scaling_table(entries), "growth": growth_table(entries), "convergence": convergence_table(entries)}


def scaling_picture(entries: list[Json]) -> dict[str, str]:
    """A line a family."""
    graphs = [{"graph": {"file": text(entry, "family"), "variables": number(entry, "graph.variables")},
               "configurations": [{"optimizer": text(entry, "family"), "seconds": {"median": number(entry, "seconds")},
                                   "peak_memory_bytes": number(entry, "peak_memory_bytes")}]}
              for entry in of_study(entries, "ten iterations") if not text(entry, "left_out")]
    return {"scaling_picture.json": json.dumps({"command": "bench", "graphs": graphs}) + "\n"}


STUDIES = [Study("scaling", study_scaling, scaling_sections, scaling_picture)]
