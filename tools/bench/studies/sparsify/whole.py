# SPDX-License-Identifier: BSD-3-Clause
"""Beyond the thesis: poses in space and larger graphs, pose by pose beside the same without taking anything out, and half of
the nodes, chosen in several ways."""
from __future__ import annotations

from ...averages import ratio
from ...data_sets import DataSet, large_sets, space_sets, sparsify_online_sets, thesis_sets
from ...pages import Sections, table
from ...program import Words
from ...reports import Json, items, median_of, number, parts, text
from ...reports import contestant as contestant_of
from ...study import Bench, Keep, Study, for_each_set
from ...words import digits, milliseconds, total
from ...words import whole as whole_number
from .runs import FEW_ROUNDS, LIMIT, blankets, contestant, loss, measure, poses_and_factors

EVERY_100 = ["--online", "100", "--keep-every", "5"]


def study_whole(bench: Bench, keep: Keep) -> None:
    def space(data: DataSet) -> None:
        for keep_every in [2, 4]:
            words = ["--keep-every", str(keep_every)]
            contestants = [contestant("default", *words), contestant("clt", *words, "--topology", "clt")]
            keep({**measure(bench, data, contestants, FEW_ROUNDS), "part": "space", "keep_every": keep_every})

    def large(data: DataSet) -> None:
        for one in [contestant("default", "--keep-every", "5"), contestant("late", *EVERY_100)]:
            keep({**measure(bench, data, [one], FEW_ROUNDS), "part": "large", "keep_every": 5})

    for_each_set("sparsify in space", space_sets(bench.data, bench.quick), space)
    for_each_set("sparsify, large", large_sets(bench.data, bench.quick), large)


# Contestants of sparsification while the graph grows, and what factors of nodes that have left are moved to.
REDIRECTIONS: dict[str, tuple[Words, str]] = {
    "late": ([], "by the most certain path"),
    "place": (["--redirect-to", "place"], "to the nearest in space, as exact"),
    "order": (["--redirect-to", "order"], "to the nearest by id, as exact"),
    "early": (["--redirect", "early"], "early, to the nearest by id, as exact"),
}


def measure_online(bench: Bench, data: DataSet) -> Json:
    contestants = [contestant(name, *EVERY_100, *more) for name, (more, _) in REDIRECTIONS.items()]
    entry = measure(bench, data, contestants, FEW_ROUNDS)
    return {**entry, "steps_of_all": bench.cairn.on("replay", data, [], 1, LIMIT).required().report["steps"]}


def study_online(bench: Bench, keep: Keep) -> None:
    for_each_set("sparsify online", sparsify_online_sets(bench.data, bench.quick), lambda data: keep(measure_online(bench, data)))


# The distance is the one at which nearly half of the nodes of M3500 leave.
SELECTIONS = ["keep_every:every=2", "least_loss:part=0.5", "smallest_blanket:part=0.5", "oldest:part=0.5",
              "coverage:distance=0.5"]


def study_selection(bench: Bench, keep: Keep) -> None:
    def measure_selections(data: DataSet) -> None:
        keep(measure(bench, data, [contestant(selection, "--select", selection) for selection in SELECTIONS], FEW_ROUNDS))

    for_each_set("sparsify, selections", thesis_sets(bench.data, bench.quick)[:1], measure_selections)


# Tables


def space_table(entries: list[Json]) -> str:
    rows = []
    for entry in parts(entries, "space"):
        cells = [text(entry, "name"), f"{number(entry, 'keep_every'):.0f}"]
        for c in items(entry, "contestants"):
            rows.append([*cells, "`clt`" if text(c, "name") == "clt" else "default", *poses_and_factors(c), *blankets(c),
                         *loss(c), digits(median_of(c, "rmse_aligned")), total(c)])
            cells = ["", ""]
    return table(["graph", "N", "topology", "poses", "factors", "blanket", "largest", "KLD", "of that means",
                  "aligned RMSE [m]", "time [s]"], rows)


def large_table(entries: list[Json]) -> str:
    rows = []
    for entry in parts(entries, "large"):
        for c in items(entry, "contestants"):
            removed = median_of(c, "poses.in") - median_of(c, "poses.kept")
            rows.append([text(entry, "name"), "every 100 poses" if text(c, "name") == "late" else "at the end",
                         *poses_and_factors(c), *blankets(c), *loss(c), digits(ratio(median_of(c, "kld"), removed)),
                         digits(median_of(c, "rmse_aligned")), total(c),
                         milliseconds(ratio(median_of(c, "seconds.total"), removed))])
    return table(["graph", "removed", "poses", "factors", "blanket", "largest", "KLD", "of that means", "KLD per node removed",
                  "aligned RMSE [m]", "time [s]", "per node removed [ms]"], rows)


def whole_sections(entries: list[Json]) -> Sections:
    return {"sparsify-space": space_table(entries), "sparsify-large": large_table(entries)}


def online_sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        late = contestant_of(entry, "late")
        rows.append([text(entry, "name"), "all nodes stay", whole_number(median_of(late, "poses.in")),
                     whole_number(median_of(late, "factors.in")), "", "", "", "",
                     *(milliseconds(number(entry, f"steps_of_all.{of}")) for of in ["median", "p99", "max"]), ""])
        for name, (_, how) in REDIRECTIONS.items():
            if c := contestant_of(entry, name):
                rows.append(["", how, *poses_and_factors(c), *loss(c), digits(median_of(c, "rmse_aligned")),
                             digits(median_of(c, "rmse_full")),
                             *(milliseconds(median_of(c, f"steps.{of}")) for of in ["median", "p99", "max"]), total(c)])
    return {"sparsify-online": table(["graph", "late factors are redirected", "poses", "factors", "KLD", "of that means",
                                      "aligned RMSE [m]", "RMSE from all measurements [m]", "median step [ms]", "99 %",
                                      "longest", "removal, all [s]"], rows)}


def selection_sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        graph = text(entry, "name")
        for c in items(entry, "contestants"):
            rows.append([graph, f"`{text(c, 'name')}`", *poses_and_factors(c), *blankets(c), *loss(c),
                         digits(median_of(c, "rmse_aligned")), digits(median_of(c, "seconds.select")), total(c)])
            graph = ""
    return {"sparsify-selection": table(["graph", "selection", "poses", "factors", "blanket", "largest", "KLD",
                                         "of that means", "aligned RMSE [m]", "selecting [s]", "removal [s]"], rows)}


STUDIES = [Study("sparsify_whole", study_whole, whole_sections), Study("sparsify_online", study_online, online_sections),
           Study("sparsify_selection", study_selection, selection_sections)]
