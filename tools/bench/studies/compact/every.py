# SPDX-License-Identifier: BSD-3-Clause
"""What `cairn compact FILE` makes of every graph of the data, by default and as a robot would."""
from __future__ import annotations

from ...data_sets import DataSet, every_graph
from ...pages import Sections, table
from ...reports import Json, member, number, text, why_none
from ...study import Bench, Keep, Study, tell
from ...words import digits, percent, whole

LIMIT = 600.0  # of a run [s]


def measure_strategy(bench: Bench, data: DataSet, strategy: list[str]) -> Json:
    run = bench.cairn.on("compact", data, strategy, 1, LIMIT)
    names = ["status", "strategy", "poses", "loops", "landmarks", "check", "whole"]
    found = {name: run.report.get(name) for name in names} if run.report else {}
    return {**found, "left_out": len(run.report["left_out"]) if run.report else 0, "seconds": run.outcome.seconds,
            "code": run.outcome.exit_code, "in_time": run.outcome.in_time}


def study_every(bench: Bench, keep: Keep) -> None:
    for data in every_graph(bench.data, bench.quick, ["pose2d", "pose3d", "landmark2d"]):
        tell(f"compact, every graph: {data.name}")
        keep({"name": data.name, "default": measure_strategy(bench, data, []),
              "fpfl": measure_strategy(bench, data, ["--strategy", "fpfl"])})


def kept(entry: Json, what: str) -> str:
    return f"{whole(number(entry, f'{what}.kept'))} of {whole(number(entry, f'{what}.in'))}"


def distance(entry: Json) -> list[str]:
    """From the estimate of all measurements, and as a part of its extent."""
    apart, extent = (number(entry, f"check.{of}") for of in ["distance", "extent"])
    return ["< 1e-5" if apart < 1e-5 else digits(apart), percent(apart / extent, 3) if extent > 0.0 else "-"]


def sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        name, ours, robot = text(entry, "name"), entry["default"], entry["fpfl"]
        if not member(ours, "status"):
            rows.append([name, why_none(ours, LIMIT), *[""] * 10])
            continue
        factors = [number(ours, f"whole.factors.{of}") for of in ["out", "in"]]
        rows.append([name, text(ours, "strategy"), kept(ours, "poses"), f"{whole(factors[0])} of {whole(factors[1])}",
                     *distance(ours), digits(number(ours, "whole.kld")), whole(number(ours, "left_out")), digits(number(ours, "seconds")),
                     kept(robot, "poses"), kept(robot, "loops"), *distance(robot)[:1]])
    return {"compact-every": table(["graph", "strategy", "poses kept", "factors", "distance [m]", "of the extent", "KLD [nats]",
                                    "left out", "time [s]", "`fpfl`: poses kept", "`fpfl`: loop closures",
                                    "`fpfl`: distance [m]"], rows)}


STUDIES = [Study("compact_every", study_every, sections)]
