# SPDX-License-Identifier: BSD-3-Clause
"""What the studies of `cairn sparsify` share."""
from __future__ import annotations

from ...data_sets import DataSet
from ...program import Words
from ...reports import Json, median_of
from ...rounds import Contestant, entries_of, run_rounds
from ...study import Bench
from ...words import digits, whole

# A run is given up after so many seconds; the longer ones are not repeated that often, so that all studies of
# `cairn sparsify` take a quarter of an hour.
LIMIT, ENOUGH = 300.0, 10.0
FEW_ROUNDS = 3


def contestant(name: str, *arguments: str) -> Contestant:
    return Contestant(name, list(arguments), LIMIT, ENOUGH)


def summary(report: Json) -> Json:
    """What the tables want of a run; of `cairn replay` there is less."""
    names = ["poses", "factors", "problems", "kld", "kld_parts", "rmse", "rmse_aligned", "rmse_full", "seconds", "steps",
             "redirected", "dropped", "loops", "kld_bound", "connectivity"]
    return {name: report[name] for name in names if name in report}


def measure(bench: Bench, data: DataSet, contestants: list[Contestant], rounds: int) -> Json:
    """The entry of interleaved runs with one thread."""
    run_rounds(1 if bench.quick else rounds, contestants,
               lambda c: bench.cairn.on("study sparsify", data, c.arguments, 1, c.limit).required(), summary)
    return {"name": data.name, "contestants": entries_of(contestants)}


def thesis_experiment(keep_every: int, scheme: str, compared_at: str = "minima") -> Words:
    """Options of the experiment of section 4.6.4 of the thesis: a node of so many stays, the others leave every hundred
    poses, and the recording has been redirected before; a file's information is taken as that of the first pose's frame; its
    KLD is that of graphs each linearised at its own minimum."""
    return ["--online", "100", "--keep-every", str(keep_every), "--redirect", "beforehand", "--information-frame", "first",
            "--scheme", scheme, "--compared-at", compared_at, "--sparsifier", "sparsify:linearize=local"]


# Tables


def poses_and_factors(c: Json) -> list[str]:
    """"701 of 3500"."""
    return [f"{whole(median_of(c, f'{of}.{which}'))} of {whole(median_of(c, f'{of}.in'))}"
            for of, which in [("poses", "kept"), ("factors", "out")]]


def blankets(c: Json) -> list[str]:
    return [digits(median_of(c, "problems.mean_blanket")), whole(median_of(c, "problems.largest_blanket"))]


def loss(c: Json) -> list[str]:
    """How far all estimates are from where they would be; of that, the means."""
    return [digits(median_of(c, "kld")), digits(median_of(c, "kld_parts.mean"))]
