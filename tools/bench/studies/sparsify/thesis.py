# SPDX-License-Identifier: BSD-3-Clause
"""The graphs of Vallvé's thesis, as in its Tables 4.1 to 4.3: several parts of the nodes left with each recovery, and two of
them with each topology and several numbers of factors."""
from __future__ import annotations

import math

from ...averages import median, ratio
from ...data_sets import DataSet, thesis_sets
from ...pages import Sections, table
from ...program import Words
from ...published import said
from ...reports import NONE, Json, items, median_of, number, parts, text
from ...reports import contestant as contestant_of
from ...rounds import Contestant
from ...study import Bench, Keep, Study, for_each_set
from ...words import digits, plain, times, total, whole
from .runs import FEW_ROUNDS, contestant, measure, thesis_experiment

KEEP_EVERY = [3, 4, 5, 10]
RECOVERIES = ["clt", "ip", "fd", "ncfd"]
# ε of the mutual information is in Λ's units, and is 1 in the program of Mazuran et al. (2016), from which the thesis takes it.
EPSILON = ":epsilon=1,absolute=true"


def by(recovery: str, experiment: Words, name: str = "") -> Contestant:
    """As many factors as twice a tree has, by one recovery; or the tree in closed form."""
    options = (["--topology", "clt" + EPSILON] if recovery == "clt" else
               ["--topology", "mi" + EPSILON, "--population", "tree:2", "--recovery", recovery])
    return contestant(name or recovery, *experiment, *options)


def at_common_states(keep_every: int, scheme: str) -> list[Contestant]:
    """Those of the thesis, and without their options what `cairn sparsify` does by itself: each KLD with both graphs
    linearised at the same states."""
    thesis = thesis_experiment(keep_every, scheme, "common")
    return [by("clt", thesis, "common clt"), by("ncfd", thesis, "common ncfd"),
            contestant("default", "--online", "100", "--keep-every", str(keep_every), "--scheme", scheme)]


def study_sets(bench: Bench, keep: Keep) -> None:
    def measure_set(data: DataSet) -> None:
        for scheme in ["single", "multi"]:
            for keep_every in KEEP_EVERY:
                contestants = at_common_states(keep_every, scheme) + [by(recovery, thesis_experiment(keep_every, scheme))
                                                                      for recovery in RECOVERIES]
                keep({**measure(bench, data, contestants, bench.rounds), "keep_every": keep_every, "scheme": scheme})

    for_each_set("sparsify", thesis_sets(bench.data, bench.quick), measure_set)


def measure_topologies(bench: Bench, data: DataSet) -> Json:
    experiment = thesis_experiment(5, "single")
    contestants = [by("clt", experiment)]
    for population in ["tree:1.5", "tree:2", "fill:0.75", "fill:0.85"]:
        for topology in ["mi", "dmi", "odd", "ekld"]:
            contestants.append(contestant(
                f"{population} {topology}", *experiment, "--topology", topology + ("" if topology == "odd" else EPSILON),
                "--population", population, "--recovery", "fd:initial=odb"))
    return {**measure(bench, data, contestants, FEW_ROUNDS), "part": "topologies"}


EPSILONS = ["1,absolute=true", "1", "0.1", "0.01", "0.0001"]  # otherwise as a fraction of Λ's mean diagonal


def measure_regularization(bench: Bench, data: DataSet) -> Json:
    """The regularisation of mutual information, of which the thesis does not say how much it is."""
    names = [f"{topology}:epsilon={epsilon}" for topology in ["clt", "mi"] for epsilon in EPSILONS]
    contestants = [contestant(name, *thesis_experiment(5, "single"), "--topology", name) for name in names]
    return {**measure(bench, data, contestants, 1), "part": "regularization"}


def study_topology(bench: Bench, keep: Keep) -> None:
    sets = thesis_sets(bench.data, bench.quick)
    for_each_set("sparsify, topologies", sets[:2], lambda data: keep(measure_topologies(bench, data)))
    for_each_set("sparsify, regularisation", sets, lambda data: keep(measure_regularization(bench, data)))


# Tables


def printed(value: float) -> str:
    """As it was printed; nothing where nothing was."""
    return plain(value) if math.isfinite(value) else ""


def against(ours: float, theirs: float) -> str:
    """"1.02 ×", or nothing without a figure to compare with."""
    return times(ratio(ours, theirs)) if math.isfinite(theirs) else ""


def beside(ours: str, theirs: float) -> str:
    """"2332 / 2332", or ours alone."""
    return f"{ours} / {plain(theirs)}" if math.isfinite(theirs) else ours


def keep_every_of(entry: Json) -> int:
    return int(number(entry, "keep_every"))


def in_thesis(entry: Json, recovery: str, column: str) -> float:
    return said("vallve2018_losses", column, graph=text(entry, "name"), scheme=text(entry, "scheme"), by=recovery,
                keep_every=keep_every_of(entry))


def counts_table(entries: list[Json]) -> str:
    """Table 4.1."""
    groups: dict[tuple[str, str], dict[int, Json]] = {}
    for entry in entries:
        groups.setdefault((text(entry, "name"), text(entry, "scheme")), {})[keep_every_of(entry)] = entry
    rows = []
    for (graph, scheme), group in groups.items():
        for topology, recovery in [("clt", "clt"), ("mi", "ncfd")]:
            if not contestant_of(next(iter(group.values())), recovery):
                continue
            problems, blankets = [], []
            for k in KEEP_EVERY:
                c = contestant_of(group.get(k), recovery)
                theirs = {of: said("vallve2018_counts", of, graph=graph, scheme=scheme, topology=topology, keep_every=k)
                          for of in ["problems", "blanket"]}
                problems.append(beside(whole(median_of(c, "problems.count")), theirs["problems"]))
                blankets.append(beside(f"{median_of(c, 'problems.mean_blanket'):.2f}", theirs["blanket"]))
            rows.append([graph, scheme, topology, *problems, *blankets])
    columns = [f"{what}, N = {k}" for what in ["problems", "nodes of a blanket"]
               for k in KEEP_EVERY]
    return table(["graph", "scheme", "topology", *columns], rows)


def recovery_table(entries: list[Json]) -> str:
    """Table 4.2."""
    rows = []
    for entry in entries:
        cells = [text(entry, "name"), text(entry, "scheme"), str(keep_every_of(entry))]
        for recovery in RECOVERIES:
            if c := contestant_of(entry, recovery):
                kld, theirs = median_of(c, "kld"), {of: in_thesis(entry, recovery, of) for of in ["kld", "rmse", "seconds"]}
                rows.append([*cells, recovery, digits(kld), printed(theirs["kld"]), against(kld, theirs["kld"]),
                             digits(median_of(c, "rmse")), printed(theirs["rmse"]), total(c), printed(theirs["seconds"])])
                cells = ["", "", ""]
    return table(["graph", "scheme", "N", "by", "KLD", "thesis's KLD", "KLD / thesis's", "RMSE [m]", "thesis's RMSE [m]",
                  "time [s]", "thesis's time [s]"], rows)


def ratios_table(entries: list[Json]) -> str:
    """Ratios to the thesis's figures over all graphs."""
    rows = []
    for recovery in RECOVERIES:
        def ratios(of: str, path: str, recovery: str = recovery, inverse: bool = False) -> list[float]:
            some = []
            for entry in entries:
                pair = [median_of(contestant_of(entry, recovery), path), in_thesis(entry, recovery, of)]
                a, b = reversed(pair) if inverse else pair
                if math.isfinite(a) and math.isfinite(b) and b > 0.0:
                    some.append(a / b)
            return some

        kld, rmse, time = ratios("kld", "kld"), ratios("rmse", "rmse"), ratios("seconds", "seconds.total", inverse=True)
        if kld:
            extremes = [times(extreme) for some in [kld, rmse]
                        for extreme in ([median(some), min(some), max(some)] if some else [NONE] * 3)]
            rows.append([recovery, str(len(kld)), *extremes, times(median(time))])
    return table(["by", "compared", *(f"{of} / thesis's: {which}" for of in ["KLD", "RMSE"] for which in ["median", "least", "largest"]),
                  "thesis's time / ours: median"], rows)


def common_table(entries: list[Json]) -> str:
    """The losses at common states: the thesis's tree and pairs, and what there is without options."""
    rows = []
    for entry in entries:
        contestants = [contestant_of(entry, name) for name in ["common clt", "common ncfd", "default"]]
        if any(contestants):
            rows.append([text(entry, "name"), text(entry, "scheme"), str(keep_every_of(entry)),
                         *(digits(median_of(c, of)) for c in contestants for of in ["kld", "rmse_aligned"]),
                         digits(median_of(contestants[-1], "rmse_full"))])
    return table(["graph", "scheme", "N", *(f"{which}: {of}" for which in ["`clt`", "`mi`, `ncfd`", "default"]
                                             for of in ["KLD", "aligned RMSE [m]"]), "default: RMSE from all measurements [m]"], rows)


def topology_table(entries: list[Json]) -> str:
    """Table 4.3."""
    rows = []
    for entry in parts(entries, "topologies"):
        graph = text(entry, "name")
        for c in items(entry, "contestants"):
            theirs = {of: said("vallve2018_topologies", of, graph=text(entry, "name"), which=text(c, "name"))
                      for of in ["kld", "rmse", "seconds", "topology_seconds", "factors"]}
            kld = median_of(c, "kld")
            rows.append([graph, f"`{text(c, 'name')}`", digits(kld), printed(theirs["kld"]), against(kld, theirs["kld"]),
                         digits(median_of(c, "rmse")), printed(theirs["rmse"]), total(c), printed(theirs["seconds"]),
                         digits(median_of(c, "seconds.topology")), printed(theirs["topology_seconds"]),
                         whole(median_of(c, "factors.out")), printed(theirs["factors"])])
            graph = ""
    return table(["graph", "population and topology", "KLD", "thesis's KLD", "KLD / thesis's", "RMSE [m]", "thesis's RMSE [m]",
                  "time [s]", "thesis's time [s]", "topology [s]", "thesis's topology [s]", "factors", "thesis's factors"], rows)


def regularization_table(entries: list[Json]) -> str:
    """A row a graph and a topology, a column an ε."""
    rows = []
    for entry in parts(entries, "regularization"):
        for topology, recovery in [("clt", "clt"), ("mi", "ncfd")]:
            theirs = said("vallve2018_losses", "kld", graph=text(entry, "name"), scheme="single", by=recovery, keep_every=5)
            klds = [median_of(contestant_of(entry, f"{topology}:epsilon={epsilon}"), "kld") for epsilon in EPSILONS]
            rows.append([text(entry, "name"), f"`{topology}`", *map(digits, klds), printed(theirs)])
    return table(["graph", "topology", "KLD, ε = 1 in Λ's units",
                  *(f"KLD, ε = {epsilon} of the mean diagonal" for epsilon in ["1", "0.1", "0.01", "0.0001"]), "thesis's KLD"], rows)


def sets_sections(entries: list[Json]) -> Sections:
    return {"sparsify-counts": counts_table(entries), "sparsify-ratios": ratios_table(entries),
            "sparsify-recovery": recovery_table(entries), "sparsify-common": common_table(entries)}


def topology_sections(entries: list[Json]) -> Sections:
    return {"sparsify-topology": topology_table(entries), "sparsify-regularization": regularization_table(entries)}


STUDIES = [Study("sparsify_sets", study_sets, sets_sections), Study("sparsify_topology", study_topology, topology_sections)]
