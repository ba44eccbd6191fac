# SPDX-License-Identifier: BSD-3-Clause
"""What `cairn sparsify FILE` makes of every pose graph of the data, without options."""
from __future__ import annotations

from ...data_sets import every_graph
from ...pages import Sections, table
from ...reports import Json, member, number, text, why_none
from ...study import Bench, Keep, Study, tell
from ...words import digits, whole
from .runs import LIMIT


def study_every(bench: Bench, keep: Keep) -> None:
    for data in every_graph(bench.data, bench.quick, ["pose2d", "pose3d"]):
        tell(f"sparsify, every graph: {data.name}")
        run = bench.cairn.on("sparsify", data, [], 1, LIMIT)
        names = ["status", "poses", "factors", "problems", "kld", "kld_parts", "rmse_aligned"]
        found = {name: run.report.get(name) for name in names} if run.report else {}
        keep({"name": data.name, **found, "seconds": run.outcome.seconds, "code": run.outcome.exit_code, "in_time": run.outcome.in_time})


def sections(entries: list[Json]) -> Sections:
    rows = []
    for entry in entries:
        if not member(entry, "status"):
            rows.append([text(entry, "name"), *[""] * 7, why_none(entry, LIMIT)])
            continue
        rows.append([text(entry, "name"), f"{whole(number(entry, 'poses.kept'))} of {whole(number(entry, 'poses.in'))}",
                     f"{whole(number(entry, 'factors.out'))} of {whole(number(entry, 'factors.in'))}",
                     whole(number(entry, "problems.largest_blanket")), digits(number(entry, "kld")),
                     digits(number(entry, "kld_parts.covariance")), digits(number(entry, "rmse_aligned")),
                     digits(number(entry, "seconds")), text(entry, "status")])
    return {"sparsify-every": table(["graph", "poses", "factors", "largest blanket", "KLD", "of that covariances",
                                     "aligned RMSE [m]", "time [s]", "status"], rows)}


STUDIES = [Study("sparsify_every", study_every, sections)]
