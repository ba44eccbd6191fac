# SPDX-License-Identifier: BSD-3-Clause
"""The path of a robot from the poses that are kept, recovered in each way, as files that `cairn plot` draws: after Figure 4 of
Ila et al. (2017)."""
from __future__ import annotations

import math

from ...data_sets import DataSet
from ...reports import Json
from ...study import Bench
from .runs import AS_PUBLISHED, BY_RULE, find_thresholds, run_compact, summary, with_truth

RECOVERIES = ["v0", "v1", "v2"]
SHOWN = 24  # poses of the detail

Lines = dict[int, str]  # of a graph in g2o's format, its poses by id


def poses_of(graph: str) -> Lines:
    return {int(line.split()[1]): line for line in graph.split("\n") if line.startswith("VERTEX_SE")}


def position(line: str) -> list[float]:
    """In the plane or in space [m]."""
    numbers = [float(word) for word in line.split()[2:]]
    return numbers[:3] if len(numbers) == 7 else numbers[:2]


def widest_stretch(one: Lines, other: Lines, count: int) -> list[int]:
    """So many consecutive ids, in whose middle the two paths are the farthest from each other."""
    ids = sorted(one.keys() & other.keys())
    if not ids:
        return []
    middle = max(range(len(ids)), key=lambda k: math.dist(position(one[ids[k]]), position(other[ids[k]])))
    begin = max(0, min(middle - count // 2, len(ids) - count))
    return ids[begin:begin + count]


def draw_recoveries(bench: Bench, plain: DataSet) -> Json:
    """Algorithm 1 as published, its path put back in each way: all of it, and the stretch on which the straight way (v0) is
    the farthest from the one along odometry (v2)."""
    data = with_truth(bench, plain)
    rule = find_thresholds(bench, data, "figures", BY_RULE)

    def file(what: str) -> str:
        return str(bench.cairn.work / f"recovery_{what}.g2o")

    def lines(name: str) -> Lines:
        with open(name, encoding="utf-8") as text:
            return poses_of(text.read())

    runs = {recovery: summary(run_compact(bench, data, [
        "--strategy", "fpfl", "--policy", AS_PUBLISHED, "--thresholds", rule.file, "--recovery", recovery,
        "--trajectory", file(recovery)]).report) for recovery in RECOVERIES}
    paths = {recovery: lines(file(recovery)) for recovery in RECOVERIES}
    if "--truth" in data.arguments:  # that of a generated graph is in no file
        paths["truth"] = lines(data.arguments[data.arguments.index("--truth") + 1])
    stretch = widest_stretch(paths["v0"], paths["v2"], SHOWN)
    for name, path in paths.items():
        with open(file(f"{name}_detail"), "w", encoding="utf-8") as out:
            out.writelines(path[k] + "\n" for k in stretch if k in path)
        with open(file(name), "w", encoding="utf-8") as out:
            out.writelines(path[k] + "\n" for k in sorted(path))
    return {"part": "recoveries", "name": data.name, "runs": runs}
