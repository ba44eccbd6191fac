# SPDX-License-Identifier: BSD-3-Clause
"""One sparsification problem by each topology and with every number of factors, after Figure 4.3 of Vallvé (2018), which shows
one number."""
from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from ...program import Words
from ...reports import NONE, Json, items, number, parts, text
from ...study import Bench

NODES, FEW_NODES = 6, 5
TOPOLOGIES = {"mi": "mi", "dmi": "dmi", "ekld": "ekld", "odd": "odd", "best:most=10000,beyond=refuse": "best"}

Solve = Callable[[Path, Words], list[Json]]  # what each topology makes of recorded problems


def middle_problem(problems: list[Json], nodes: int) -> Json:
    """Of so many nodes that with the middle divergence; None if there is none."""
    those = sorted((problem for problem in problems if len(problem["sizes"]) == nodes), key=lambda problem: number(problem, "kld"))
    return those[len(those) // 2] if those else None


def measure_example(bench: Bench, problems: Path, solve: Solve) -> Json:
    """The divergence by topology and number of factors: from a tree to all pairs but one, as with all nothing is lost."""
    nodes = FEW_NODES if bench.quick else NODES  # `best` tries all topologies, 32 times as many with six
    problem = middle_problem(json.loads(problems.read_text(encoding="utf-8"))["problems"], nodes)
    rows: list[Json] = []
    if problem:
        file = bench.cairn.work / "example_problem.json"
        file.write_text(json.dumps({"problems": [problem]}), encoding="utf-8")
        all_pairs = nodes * (nodes - 1) // 2
        for factors in range(nodes - 1, all_pairs):
            words = ["--population", f"fill:{factors / all_pairs!r}", "--recovery", "ncfd"]
            for topology in TOPOLOGIES:
                words += ["--topology", topology]
            rows += [{"factors": factors, "topology": text(row, "topology"), "kld": number(row, "kld")}
                     for row in solve(file, words) if row["nodes"] is None]
    return {"part": "example", "nodes": nodes, "rows": rows}


def example_curves(entries: list[Json]) -> dict[str, str]:
    """A column a topology, a row a number of factors, as CSV."""
    files = {}
    for entry in parts(entries, "example"):
        curves: dict[str, dict[int, float]] = {f"KLD, {title}": {} for title in TOPOLOGIES.values()}
        for row in items(entry, "rows"):
            kld = number(row, "kld")
            curves[f"KLD, {text(row, 'topology').partition(':')[0]}"][int(number(row, "factors"))] = kld if kld > 0.0 else NONE
        files["sparsify_example.csv"] = pd.DataFrame(curves).rename_axis("factors").to_csv()
    return files
