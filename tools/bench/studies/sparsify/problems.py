# SPDX-License-Identifier: BSD-3-Clause
"""Single sparsification problems, as in Figures 4.5 to 4.9 of Vallvé (2018): those that come up in the thesis's experiment,
and those of the whole graph, which are larger."""
from __future__ import annotations

import math
from pathlib import Path

from ...data_sets import DataSet, thesis_sets
from ...pages import Sections, table
from ...program import Words
from ...reports import NONE, Json, items, number, text
from ...study import Bench, Keep, Study, attempt
from ...words import digits, whole
from .example import example_curves, measure_example
from .runs import thesis_experiment

RECORDINGS = {"online": "every 100 poses", "whole": "whole graph"}
METHODS = ["fd", "ncfd", "ip", "pqn"]
GUESSES = ["identity", "odb", "ffd", "scaled"]
TOPOLOGIES = ["mi", "dmi", "ekld", "odd", "l1", "best"]
SAME_FACTORS = ["--topology", "mi", "--population", "tree:2"]


def each(option: str, values: Words) -> Words:
    """The option once for each of its values."""
    return [word for value in values for word in [option, value]]


def record_problems(bench: Bench, data: DataSet, name: str, arguments: Words) -> Path:
    """One run that writes the problems that come up, and the sparse graph."""
    file, sparse = bench.cairn.work / f"{name}_problems.json", bench.cairn.work / f"sparsify_{name}.g2o"
    bench.cairn.on("study sparsify", data, [*arguments, "--no-kld", "--record", str(file), "-o", str(sparse)]).required()
    return file


def solve_problems(bench: Bench, problems: Path, arguments: Words) -> list[Json]:
    """What each topology and each recovery among the arguments makes of recorded problems."""
    return items(bench.cairn.on("study problems", DataSet("problems", str(problems)), arguments).required().report, "rows")


def draw_convergence(bench: Bench, problems: Path) -> None:
    """The curves of Figures 4.6 (against iterations, from several beginnings) and 4.7 (against time), as CSV, which
    ./dev bench draws."""
    for file, over, recoveries in [
            ("sparsify_iterations.csv", "iterations", ["ip:initial=identity", "pqn:initial=identity", "pqn:initial=odb",
                                                       "fd:initial=identity", "fd:initial=odb", "fd:initial=ffd"]),
            ("sparsify_times.csv", "time", ["ip:initial=odb", "fd", "ncfd"])]:
        solve_problems(bench, problems, [*SAME_FACTORS, *each("--recovery", recoveries),
                                         "--curves", str(bench.cairn.work / file), "--against", over])


def measure_problems(bench: Bench, data: DataSet, recording: str, arguments: Words, most: int, keep: Keep) -> None:
    """`most`: `best` tries no more topologies than this."""
    problems = record_problems(bench, data, recording, [*arguments, "--topology", "mi"])

    def part(name: str, words: Words) -> None:
        keep({"part": name, "name": data.name, "recording": recording, "rows": solve_problems(bench, problems, words)})

    part("recovery", [*SAME_FACTORS, *each("--recovery", METHODS)])
    part("tight", [*SAME_FACTORS, *each("--recovery", [f"{method}:tolerance=1e-6" for method in METHODS])])
    part("initial", [*SAME_FACTORS, *each("--recovery", [f"fd:initial={guess},iterations=0" for guess in GUESSES] + ["ncfd"])])
    if recording == "online":
        draw_convergence(bench, problems)
    else:
        # ./dev bench draws the sparse graph over the original one, as in Figure 4.8.
        bench.cairn.optimize(data, ["-o", str(bench.cairn.work / "sparsify_original.g2o")]).required()
        keep(measure_example(bench, problems, lambda file, words: solve_problems(bench, file, words)))
    topologies = [*TOPOLOGIES[:-1], f"best:most={most},beyond=refuse"]
    part("topology", ["--population", "fill:0.75", "--recovery", "ncfd", *each("--topology", topologies)])


def study_problems(bench: Bench, keep: Keep) -> None:
    data = thesis_sets(bench.data, bench.quick)[0]
    # All topologies of six nodes with a part of 0.75; of five.
    attempt("sparsify, problems: online", lambda: measure_problems(
        bench, data, "online", thesis_experiment(5, "single"), 100 if bench.quick else 1000, keep))
    attempt("sparsify, problems: whole", lambda: measure_problems(bench, data, "whole", ["--keep-every", "5"], 100, keep))


# Tables


def part_of(entries: list[Json], part: str, recording: str) -> Json:
    """None if there is none."""
    return next((entry for entry in entries if text(entry, "part") == part and text(entry, "recording") == recording), None)


def nodes_of(row: Json) -> int:
    """0 stands for problems of all sizes."""
    nodes = number(row, "nodes")
    return int(nodes) if math.isfinite(nodes) else 0


def sizes(entry: Json) -> list[int]:
    return sorted({nodes_of(row) for row in items(entry, "rows")})


def value(entry: Json, member: str, which: str, nodes: int, path: str) -> float:
    """`which` is a topology ("mi") or a recovery ("ncfd"), as it begins before its options, or "mi" and "ncfd:initial=odb"
    with the options that matter."""
    for row in items(entry, "rows"):
        if (text(row, member) + ",").startswith((which + ":", which + ",")) and nodes_of(row) == nodes:
            return number(row, path)
    return NONE


def nats(kld: float) -> str:
    """KLD that is nothing but rounding is 0."""
    return "0" if abs(kld) < 1e-12 else digits(kld)


def size_name(nodes: int) -> str:
    return str(nodes) if nodes else "all"


def small(excess: float) -> str:
    if not math.isfinite(excess):
        return "-"
    return "0" if excess < 1e-12 else f"{excess:.0e}"


def failures(entries: list[tuple[Json, str]]) -> str:
    """Which did not do what they should, over all problems; the entries with their tolerances."""
    runs, said = 0.0, ""
    for entry, tolerance in entries:
        for row in items(entry, "rows"):
            if nodes_of(row) != 0:
                continue
            runs += number(row, "problems") + number(row, "refused")
            who = text(row, "recovery").partition(":")[0]
            for what, title in [("not_converged", "did not converge"), ("not_positive", "gave no positive definite matrix"),
                                ("refused", "were refused")]:
                if number(row, what) > 0.0:
                    said += f"; {number(row, what):.0f} {title} (`{who}`, to {tolerance})"
    return f"{runs:.0f} recoveries{said or ': all converged to positive definite matrices'}.\n"


def recovery_tables(entries: list[Json]) -> str:
    excess, work, checked = [], [], []
    for recording, title in RECORDINGS.items():
        loose, tight = part_of(entries, "recovery", recording), part_of(entries, "tight", recording)
        for nodes in sizes(loose):
            def of(entry: Json, method: str, path: str, nodes: int = nodes) -> float:
                return value(entry, "recovery", method, nodes, path)

            begin = [title, size_name(nodes)]
            excess.append([*begin, whole(of(loose, "ip", "problems")), digits(of(loose, "ip", "factors")),
                           nats(of(loose, "ip", "kld")), *(small(of(entry, method, "largest_excess"))
                                                           for entry in [loose, tight] for method in METHODS)])
            work.append([*begin, *(digits(of(loose, method, "iterations")) for method in METHODS),
                         *(digits(1e6 * of(loose, method, "seconds.recovery_median")) for method in METHODS)])
            title = ""
        checked += [(entry, tolerance) for entry, tolerance in [(loose, "1e-3"), (tight, "1e-6")] if loose and entry]
    columns, worked = ([f"{what}: `{method}`" for what in both for method in METHODS] for both in [
        ["above the least, to 1e-3", "above the least, to 1e-6"], ["iterations", "median time [µs]"]])
    return (table(["recorded", "nodes", "problems", "factors", "KLD", *columns], excess) + "\n"
            + table(["recorded", "nodes", *worked], work) + "\n" + failures(checked))


def initial_table(entries: list[Json]) -> str:
    rows = []
    for recording, title in RECORDINGS.items():
        entry = part_of(entries, "initial", recording)
        for nodes in sizes(entry):
            if nodes == 2:
                continue  # one factor, which any of them finds
            klds = [[value(entry, "recovery", method, nodes, of) for of in ["kld", "kld_deviation"]]
                    for method in [*(f"fd:initial={guess}" for guess in GUESSES), "ncfd"]]
            rows.append([title, size_name(nodes), whole(value(entry, "recovery", "ncfd", nodes, "problems")),
                         *(f"{nats(kld)} ± {nats(deviation)}" for kld, deviation in klds)])
            title = ""
    return table(["recorded", "nodes", "problems", "identity", "`odb`", "`ffd`", "`scaled`", "minimum"], rows)


def topologies_table(entries: list[Json]) -> str:
    rows = []
    for recording, title in RECORDINGS.items():
        entry = part_of(entries, "topology", recording)
        for nodes in sizes(entry):
            if nodes == 2:
                continue

            def of(topology: str, path: str, entry: Json = entry, nodes: int = nodes) -> float:
                # A mean over those that it did is no mean over all.
                refused = value(entry, "topology", topology, nodes, "refused") > 0.0
                return NONE if refused else value(entry, "topology", topology, nodes, path)

            rows.append([title, size_name(nodes), whole(of("mi", "problems")), digits(of("mi", "factors")),
                         *(nats(of(topology, "kld")) for topology in TOPOLOGIES),
                         *(digits(1e6 * of(topology, "seconds.topology")) for topology in TOPOLOGIES)])
            title = ""
    columns = [f"{what}: `{topology}`" for what in ["KLD", "time [µs]"]
               for topology in TOPOLOGIES]
    return table(["recorded", "nodes", "problems", "factors", *columns], rows)


def sections(entries: list[Json]) -> Sections:
    return {"sparsify-problems": recovery_tables(entries), "sparsify-initial": initial_table(entries),
            "sparsify-topologies": topologies_table(entries)}


STUDIES = [Study("sparsify_problems", study_problems, sections, example_curves)]
