# SPDX-License-Identifier: BSD-3-Clause
"""What default settings make of a world, beside the best that is known of it."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import List, Optional, Tuple

import numpy as np

import cairn
from worlds import World, with_states

"""Above the best known chi2 by more than this fraction is another minimum, or none."""
TOLERANCE = 1e-3
"""chi2 below this part of the residuals' number is an exact graph's."""
ROUNDING = 1e-9
"""Beyond this chi2 per degree of freedom no estimate is plausible, whatever its minimum (docs/reliability.md)."""
IMPLAUSIBLE = 25.0
STARTS: List[Optional[str]] = [None, "odometry", "spanning_tree", "spanning_tree:weight=information", "chordal", "incremental", "incremental:step=10",
                               "auto"]
OPTIMIZERS = ["levenberg_marquardt", "dogleg"]


@dataclass
class Verdict:
    """A finding has one of the words of `FINDINGS`; else it is empty."""

    kind: str
    seed: int
    finding: str = ""
    name: str = ""
    chi2: float = 0.0
    best: float = 0.0
    best_from: str = ""
    doubts: List[str] = field(default_factory=list)
    notes: List[str] = field(default_factory=list)
    doubt_is_right: bool = True
    only_the_truth: bool = False


FINDINGS = {
    "silent": "code 0, no doubt, and above the best known minimum",
    "false": "a doubt about an estimate that is at the best known minimum of a graph without defects",
    "not converged": "code 4",
    "error": "an exception, or the end of the process",
}


def solve(world: World, states: cairn.Graph, optimizer: str, initial: Optional[str]) -> Tuple[float, cairn.Summary]:
    graph = states.copy()
    summary = cairn.optimize(graph, optimizer, initial=initial, loss=world.loss, loss_on=world.loss_on)
    return summary.chi2, summary


def candidates(world: World):
    """Each start with each optimizer: the states and the name of an initial guess."""
    for optimizer in OPTIMIZERS:
        for start in STARTS:
            if start == "auto" and optimizer == OPTIMIZERS[0]:
                continue  # the default itself
            yield f"{start or 'as_given'} with {optimizer}", world.graph, optimizer, start
        yield f"truth with {optimizer}", with_states(world.graph, world.truth), optimizer, None
    if world.loss:
        # The estimate without the measurements that the truth contradicts most: what a perfect rejection would do.
        plain = with_states(world.graph, world.truth)
        cairn.optimize(plain, initial=None, loss="cauchy", loss_on=world.loss_on)
        yield "truth by way of cauchy", plain, OPTIMIZERS[0], None


@dataclass
class Best:
    """The lowest chi2 that is known, from where, and the lowest that needs no truth; the least to which the truth leads."""

    chi2: float
    name: str
    without_truth: float
    from_truth: float = np.inf


def best_of(world: World, default_chi2: float) -> Best:
    best = Best(default_chi2, "the default", default_chi2)
    for start, states, optimizer, initial in candidates(world):
        try:
            chi2, _ = solve(world, states, optimizer, initial)
        except cairn.Error:
            continue  # a start that this graph does not allow
        if not np.isfinite(chi2):
            continue
        if start.startswith("truth"):
            best.from_truth = min(best.from_truth, chi2)
        else:
            best.without_truth = min(best.without_truth, chi2)
        if chi2 < best.chi2:
            best.chi2, best.name = chi2, start
    return best


def is_above(chi2: float, best: float, world: World) -> bool:
    floor = ROUNDING * world.expected * max(1, world.graph.factor_count)
    return not chi2 <= best * (1.0 + TOLERANCE) + floor


def judge(kind: str, seed: int, world: World, initial: Optional[str] = "auto", alone: bool = False) -> Verdict:
    """`alone`: compared with chi2 at the truth, which any minimum worth the name is below, and with no other optimisation."""
    verdict = Verdict(kind, seed, name=world.name + (f"; --loss {world.loss} --loss-on {world.loss_on}" if world.loss else ""))
    verdict.chi2, summary = solve(world, world.graph, OPTIMIZERS[0], initial)
    verdict.notes = list(summary.notes)
    verdict.doubts = list(summary.doubts)
    if alone:
        truth = with_states(world.graph, world.truth)
        truth.set_loss(world.loss, world.loss_on)
        verdict.best, verdict.best_from = truth.chi2(), "the truth itself"
        astray = False
    else:
        best = best_of(world, verdict.chi2)
        verdict.best, verdict.best_from = best.chi2, best.name
        verdict.only_the_truth = is_above(best.without_truth, best.chi2, world)
        # The estimate is the lowest, and yet not that of the truth: noise has made another minimum the lowest.
        astray = is_above(best.from_truth, best.chi2, world)
    above = is_above(verdict.chi2, verdict.best, world)
    if not summary.converged:
        verdict.finding = "not converged"
    elif above and not verdict.doubts:
        verdict.finding = "silent"
    if verdict.doubts and summary.converged and not above:
        residuals = max(1, world.graph.factor_count)
        verdict.doubt_is_right = bool(world.defects) or astray or verdict.best > IMPLAUSIBLE * residuals
        if not verdict.doubt_is_right and not alone:
            verdict.finding = "false"
    return verdict
