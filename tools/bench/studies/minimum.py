# SPDX-License-Identifier: BSD-3-Clause
"""Time to the minimum: of every optimizer, from every initial guess, until chi2 is within 1e-6 of the lowest found."""
from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from dataclasses import dataclass

from ..averages import geometric_mean, median, ratio
from ..data_sets import DataSet, pose_graphs
from ..pages import Sections, table
from ..processes import run_program
from ..program import Failed, Run, Words, parsed
from ..reports import NONE, Json, contestant, items, member, number, text
from ..rounds import Contestant, entries_of, run_rounds
from ..study import Bench, Keep, Study, for_each_set
from ..words import digits, milliseconds, percent, times, whole

OPTIMIZERS = ["levenberg_marquardt", "dogleg", "gauss_newton", "ceres"]
DEFAULT = OPTIMIZERS[0]
STARTS = ["as_given", "odometry", "spanning_tree", "chordal"]
AUTO = "auto"
LIMIT = 3.0  # of a run, by its own clock [s]
PATIENCE = 120.0  # until it is given up [s]
ENOUGH = 3.0  # no more rounds of what would take longer together [s]
SAME_START = 1e-3  # of chi2: odometry is what many files have as states, up to their digits
CLOSE, ROUNDING = 1e-6, 1e-12  # of the lowest chi2, and of chi2 of the states as given: within either is the minimum


# Measuring


@dataclass(frozen=True)
class Peer:
    """A program for which cairn has no plugin: it is called with a file in g2o's format, its states as the start, and prints
    the members "chi2", "seconds", "status" and "iterations" of the report of `cairn optimize`."""

    name: str
    command: Words

    @staticmethod
    def of(given: str) -> Peer:
        """Of "NAME=COMMAND". Raises ValueError."""
        name, equals, command = given.partition("=")
        if not equals or not name or not command.split():
            raise ValueError(f"'{given}' is not NAME=COMMAND")
        return Peer(name, shlex.split(command))


def curve_of(report: Json) -> list[list[float]]:
    """[chi2, seconds]: of the start and after each iteration, counted from the begin of the run. What is not in an iteration,
    such as the analysis of the structure, counts as before the first."""
    steps = items(report, "iterations")
    now = number(report, "seconds.total") - sum(number(step, "seconds") for step in steps)
    curve = [[number(report, "chi2.initial"), now]]
    for step in steps:
        now += number(step, "seconds")
        curve.append([number(step, "chi2"), now])
    return curve


def summary_of(report: Json) -> Json:
    return {"status": text(report, "status"), "chi2": number(report, "chi2.final"),
            "initial_seconds": number(report, "seconds.initial"), "curve": curve_of(report)}


class Graph:
    """One graph from one start."""

    def __init__(self, bench: Bench, data: DataSet, start: str):
        self.bench, self.data, self.start = bench, data, start
        self.peers = {peer.name: peer for peer in map(Peer.of, bench.peers)}
        self.file = bench.cairn.work / "start.g2o"

    def optimize(self, more: Words) -> Run:
        return self.bench.cairn.optimize(self.data, ["--initial", self.start, *more], 1, PATIENCE).required()

    def initial(self) -> Json:
        """The report of no iteration; the states are in `file`, too, if there is a peer."""
        write = ["-o", str(self.file)] if self.peers else []
        run = self.optimize(["--optimizer", DEFAULT, "--iterations", "0", *write])
        if run.report is None:
            raise Failed(f"no start after {PATIENCE:.0f} s")
        return run.report

    def run(self, one: Contestant) -> Run:
        if one.name in self.peers:
            words = [*self.peers[one.name].command, str(self.file)]
            outcome = run_program(words, self.bench.cairn.work, PATIENCE)
            return Run(outcome, parsed(outcome.output)).required()
        return self.optimize(["--optimizer", one.name, "--max-seconds", f"{LIMIT:g}"])

    def measured(self, names: list[str], initial: Json) -> Json:
        contestants = [Contestant(name, limit=PATIENCE, enough=ENOUGH) for name in names]
        run_rounds(self.bench.rounds_of_runs, contestants, self.run, summary_of)
        return {"name": self.start, "chi2": number(initial, "chi2.initial"), "notes": member(initial, "initial_notes"),
                "contestants": entries_of(contestants)}


def study_minimum(bench: Bench, keep: Keep) -> None:
    optimizers = bench.cairn.accepted("--optimizer", OPTIMIZERS)

    def measure(data: DataSet) -> None:
        starts: list[Json] = []
        report: Json = None
        for name in [*STARTS, AUTO]:
            graph = Graph(bench, data, name)
            report = graph.initial()
            known = starts[0]["chi2"] if starts else NONE
            if name == "odometry" and abs(number(report, "chi2.initial") - known) <= SAME_START * known:
                starts[0]["also"] = name
            else:
                # The states of `auto` are those of one of the others: what matters is what it costs.
                starts.append(graph.measured([DEFAULT] if name == AUTO else [*optimizers, *graph.peers], report))
        keep({"name": data.name, "generated": data.generated, "graph": report["graph"], "starts": starts})

    for_each_set("minimum", pose_graphs(bench.data, bench.quick), measure)


# What became of a run


def lowest(entry: Json) -> float:
    """The lowest chi2 that anybody found."""
    found = [number(run, "chi2") for start in items(entry, "starts") for one in items(start, "contestants")
             for run in items(one, "runs")]
    return min((chi2 for chi2 in found if math.isfinite(chi2)), default=NONE)


def bound(entry: Json) -> float:
    """chi2 up to which it is the minimum."""
    least = lowest(entry)
    return least + max(CLOSE * least, ROUNDING * max((number(start, "chi2") for start in items(entry, "starts")[:1]), default=0.0))


def reached(run: Json, enough: float) -> tuple[float, float]:
    """Seconds and iterations until chi2 is that low; NaN if it never is."""
    for iterations, (chi2, seconds) in enumerate(items(run, "curve")):
        if chi2 is not None and chi2 <= enough:
            return seconds, float(iterations)
    return NONE, NONE


def times_of(one: Json, enough: float) -> tuple[float, float]:
    """Medians of the runs of a contestant."""
    found = [reached(run, enough) for run in items(one, "runs")]
    found = [each for each in found if math.isfinite(each[0])]
    return median([seconds for seconds, _ in found]), median([iterations for _, iterations in found])


def in_words(one: Json, enough: float) -> str:
    """"12.3 (8)": milliseconds and iterations; or where it ended instead."""
    if one is None:
        return "-"
    seconds, iterations = times_of(one, enough)
    if math.isfinite(seconds):
        return f"{milliseconds(seconds)} ({whole(iterations)})"
    runs = items(one, "runs")
    if not runs or not math.isfinite(number(runs[0], "chi2")):
        return "not reached"
    where = "other minimum" if text(runs[0], "status") == "converged" else "not reached"
    return f"{where}: {number(runs[0], 'chi2'):.6g}"


def start_seconds(start: Json) -> float:
    """What the initial guess took."""
    return median([seconds for one in items(start, "contestants") for run in items(one, "runs")
                   if math.isfinite(seconds := number(run, "initial_seconds"))])


def start_in_words(start: Json) -> str:
    also = text(start, "also")
    return f"{text(start, 'name')}, {also}" if also else text(start, "name")


# Tables


def names_in(entries: list[Json]) -> list[str]:
    """Of all contestants, in the order in which they first ran."""
    return list(dict.fromkeys(text(one, "name") for entry in entries for start in items(entry, "starts")
                              for one in items(start, "contestants")))


def compared(entry: Json) -> Iterator[Json]:
    return (start for start in items(entry, "starts") if text(start, "name") != AUTO)


def detail_table(entries: list[Json], names: list[str]) -> str:
    rows = [[text(entry, "name"), start_in_words(start), milliseconds(start_seconds(start)),
             *(in_words(contestant(start, name), bound(entry)) for name in names)]
            for entry in entries for start in compared(entry)]
    return table(["graph", "start", "start [ms]", *(f"`{name}`" if name in OPTIMIZERS else name for name in names)], rows)


def summary_table(entries: list[Json], names: list[str]) -> str:
    """Of each start and optimizer: on how many graphs it reaches the minimum, and its time as a multiple of the default's."""
    rows = []
    for start_name in STARTS:
        starts = [(start, bound(entry)) for entry in entries for start in compared(entry)
                  if start_name in (text(start, "name"), text(start, "also"))]
        cells = []
        for name in names:
            at = [(times_of(contestant(start, name), enough)[0], times_of(contestant(start, DEFAULT), enough)[0])
                  for start, enough in starts if contestant(start, name) is not None]
            ratios = [ratio(mine, default) for mine, default in at if math.isfinite(mine) and math.isfinite(default)]
            cells.append(f"{sum(math.isfinite(mine) for mine, _ in at)} of {len(at)}, {times(geometric_mean(ratios))}")
        rows.append([start_name, *cells])
    return table(["start", *(f"`{name}`" if name in OPTIMIZERS else name for name in names)], rows)


def best_way(entry: Json) -> tuple[float, str]:
    """The least time of start and optimizer together, and whose it is."""
    ways = [(start_seconds(start) + times_of(one, bound(entry))[0], f"{text(start, 'name')}, {text(one, 'name')}")
            for start in compared(entry) for one in items(start, "contestants")]
    return min((way for way in ways if math.isfinite(way[0])), default=(NONE, "-"))


def chosen_by_auto(start: Json) -> str:
    """Its note begins with the name of the start that it took; without one there was but one."""
    notes = items(start, "notes")
    return str(notes[0]).partition(" ")[0] if notes else "as_given"


def auto_table(entries: list[Json]) -> str:
    rows = []
    for entry in entries:
        start = next((start for start in items(entry, "starts") if text(start, "name") == AUTO), None)
        if start is None:
            continue
        enough = bound(entry)
        guess, then = start_seconds(start), times_of(contestant(start, DEFAULT), enough)[0]
        best, way = best_way(entry)
        rows.append([text(entry, "name"), f"{number(entry, 'graph.variables'):.0f}", f"{number(entry, 'graph.factors'):.0f}",
                     f"{lowest(entry):.8g}", chosen_by_auto(start), milliseconds(guess),
                     in_words(contestant(start, DEFAULT), enough), percent(ratio(guess, guess + then)), milliseconds(best), way,
                     digits(ratio(guess + then, best))])
    return table(["graph", "poses", "factors", "lowest chi2", "start chosen", "`auto` [ms]", f"`{DEFAULT}` [ms]", "`auto`'s share",
                  "fastest of all [ms]", "which is", "both / fastest"], rows)


def minimum_sections(entries: list[Json]) -> Sections:
    names = names_in(entries)
    return {"minimum-summary": summary_table(entries, names), "minimum-auto": auto_table(entries),
            "minimum": detail_table(entries, names)}


STUDIES = [Study("minimum", study_minimum, minimum_sections)]
