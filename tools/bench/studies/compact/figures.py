# SPDX-License-Identifier: BSD-3-Clause
"""Maps and covariances of compact pose SLAM, as files that `cairn plot` draws: after Figures 3, 4, 6 and 7 of Ila et al.
(2017)."""
from __future__ import annotations

import json

from ...data_sets import DataSet, compact_sets_named
from ...pages import Sections, table
from ...reports import Json, number, parts, text
from ...study import Bench, Keep, Study, for_each_set
from ...words import digits, whole
from .recoveries import draw_recoveries
from .runs import ALL_LOOPS, AS_PUBLISHED, BY_RULE, find_thresholds, named_once, part_kept, run_compact, summary, with_truth

WITH_NORMS = ["ellipse3d"]  # of covariances, which takes longer


def draw_set(bench: Bench, plain: DataSet) -> Json:
    """Thresholds by the rule and Algorithm 1 as it was published: what the paper's figures show."""
    data = with_truth(bench, plain)
    rule = find_thresholds(bench, data, "figures", BY_RULE)
    name = data.name.replace(" ", "_").replace(",", "_")

    def file(what: str) -> str:
        return str(bench.cairn.work / f"figure_{name}_{what}")

    def run(strategy: str, policy: str, *more: str) -> Json:
        words = ["--strategy", strategy, "--policy", policy, "--thresholds", rule.file, *more]
        return summary(run_compact(bench, data, words).report)

    entry = {"name": data.name, "apal": run("apal", ALL_LOOPS, "-o", file("apal.g2o")),
             "apfl": run("apfl", AS_PUBLISHED, "-o", file("apfl.g2o")),
             "fpfl": run("fpfl", AS_PUBLISHED, "-o", file("fpfl.g2o"), "--trajectory", file("trajectory.g2o"),
                         *(["--compare", file("norms.csv")] if name in WITH_NORMS else []))}
    # The covariances of the poses kept, as the report of an optimisation has them for `cairn plot`.
    optimized = bench.cairn.optimize(DataSet(data.name, file("fpfl.g2o"), plain.arguments),
                                     ["--covariance", "blocks", "-o", file("fpfl_optimized.g2o")]).required()
    with open(file("fpfl.json"), "w", encoding="utf-8") as out:
        json.dump(optimized.report, out)
    return entry


def study_figures(bench: Bench, keep: Keep) -> None:
    sets = compact_sets_named(["ellipse3d", "parking-garage", "manhattanOlson3500_isam"], bench.data, bench.quick)
    for_each_set("compact, figures", sets, lambda data: keep(draw_set(bench, data)))
    sets = compact_sets_named(["ellipse3d" if bench.quick else "kitti_00, simulated"], bench.data, bench.quick)
    for_each_set("compact, recovered paths", sets, lambda data: keep(draw_recoveries(bench, data)))


def part(entry: Json, of: str) -> list[str]:
    kept = number(entry, f"{of}.kept")
    return [whole(kept), part_kept(kept, number(entry, f"{of}.in"))]


def sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in parts(entries, ""):
        some = [[title, *part(entry, f"{strategy}.poses"), *part(entry, f"{strategy}.loops"),
                 *(digits(number(entry, f"{strategy}.errors.v2.ate.{of}")) for of in ["translation", "rotation"])]
                for strategy, title in [("apal", "(a) all poses, all loop closures"),
                                        ("apfl", "(b) all poses, few loop closures"), ("fpfl", "(c) few of both")]]
        rows += named_once(some, text(entry, "name"))
    return {"compact-figures": table(["graph", "strategy", "poses", "of all poses", "loop closures", "of all loop closures", "ATE [m]",
                                      "ATE [°]"], rows)}


STUDIES = [Study("compact_figures", study_figures, sections)]
