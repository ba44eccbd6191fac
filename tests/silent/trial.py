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
STARTS: List[Optional[str]] = [None, "odometry", "spanning_tree", "chordal", "incremental", "auto"]
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


def solve(world: World, states: cairn.Graph, optimizer: str, initial: Optional[str]) -> Tuple[float, cairn.Summary, cairn.Graph]:
    graph = states.copy()
    summary = cairn.optimize(graph, optimizer, initial=initial, loss=world.loss, loss_on=world.loss_on)
    return summary.chi2, summary, graph


def candidates(world: World, default: cairn.Graph):
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


def best_of(world: World, default_chi2: float, default: cairn.Graph) -> Tuple[float, str, bool]:
    best, name, only_truth = default_chi2, "the default", False
    others = default_chi2
    for start, states, optimizer, initial in candidates(world, default):
        try:
            chi2, summary, _ = solve(world, states, optimizer, initial)
        except cairn.Error:
            continue  # a start that this graph does not allow
        if not np.isfinite(chi2):
            continue
        if not start.startswith("truth"):
            others = min(others, chi2)
        if chi2 < best:
            best, name = chi2, start
    if name.startswith("truth"):
        only_truth = is_above(others, best, world)
    return best, name, only_truth


def is_above(chi2: float, best: float, world: World) -> bool:
    floor = ROUNDING * world.expected * max(1, world.graph.factor_count)
    return not chi2 <= best * (1.0 + TOLERANCE) + floor


def judge(kind: str, seed: int, world: World, initial: Optional[str] = "auto", alone: bool = False) -> Verdict:
    """`alone`: compared with chi2 at the truth, which any minimum worth the name is below, and with no other optimisation."""
    verdict = Verdict(kind, seed, name=world.name + (f"; --loss {world.loss} --loss-on {world.loss_on}" if world.loss else ""))
    verdict.chi2, summary, estimate = solve(world, world.graph, OPTIMIZERS[0], initial)
    verdict.notes = list(summary.notes)
    verdict.doubts = list(summary.doubts)
    if alone:
        truth = with_states(world.graph, world.truth)
        truth.set_loss(world.loss, world.loss_on)
        verdict.best, verdict.best_from = truth.chi2(), "the truth itself"
    else:
        verdict.best, verdict.best_from, verdict.only_the_truth = best_of(world, verdict.chi2, estimate)
    above = is_above(verdict.chi2, verdict.best, world)
    if not summary.converged:
        verdict.finding = "not converged"
    elif above and not verdict.doubts:
        verdict.finding = "silent"
    if verdict.doubts and summary.converged and not above:
        residuals = max(1, world.graph.factor_count)
        verdict.doubt_is_right = bool(world.defects) or verdict.best > IMPLAUSIBLE * residuals
        if not verdict.doubt_is_right and not alone:
            verdict.finding = "false"
    return verdict
