# SPDX-License-Identifier: BSD-3-Clause
"""Means with their 95 % confidence intervals by Student's t, as `cairn explore` has them, and medians by order statistics.

SciPy, which has the quantile of t, cannot be installed beside Boost 1.81 on Debian 12.
"""
from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .reports import NONE


@functools.cache
def student_t_quantile(p: float, dof: int) -> float:
    """x with P(T ≤ x) = p > 1/2. With x = √dof tan θ the density of T becomes cos^(dof − 1) θ over ∫ of the same,
    √π Γ(dof / 2) / Γ((dof + 1) / 2); θ is found by bisection, the integral from 0 by Gauss and Legendre's rule."""
    nodes, weights = np.polynomial.legendre.leggauss(64)  # type: ignore[no-untyped-call]
    wanted = (p - 0.5) * math.sqrt(math.pi) * math.exp(math.lgamma(dof / 2) - math.lgamma((dof + 1) / 2))
    low, high = 0.0, math.pi / 2
    for _ in range(60):
        theta = 0.5 * (low + high)
        integral = 0.5 * theta * float(weights @ np.cos(0.5 * theta * (nodes + 1.0)) ** (dof - 1))
        low, high = (theta, high) if integral < wanted else (low, theta)
    return math.sqrt(dof) * math.tan(0.5 * (low + high))


@dataclass
class MeanInterval:
    count: int = 0  # of the numbers that are finite
    mean: float = NONE
    half_width: float = NONE  # of the interval; NaN of one number

    def excludes_zero(self) -> bool:
        return math.isfinite(self.half_width) and abs(self.mean) > self.half_width

    def text(self, sign: bool = False) -> str:
        """"22 ± 25", with two digits of the half width; "-" of nothing."""
        if self.count == 0:
            return "-"
        known = math.isfinite(self.half_width)
        scale = self.half_width if known and self.half_width > 0.0 else 0.01 * abs(self.mean)
        decimals = min(max(1 - math.floor(math.log10(scale)), 0), 4) if scale > 0.0 else 0
        mean = f"{self.mean:+.{decimals}f}" if sign else f"{self.mean:.{decimals}f}"
        return mean + (f" ± {self.half_width:.{decimals}f}" if known else "")


def mean_interval(values: Sequence[float]) -> MeanInterval:
    """Of the values that are finite, taken as independent and normally distributed."""
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return MeanInterval()
    mean = float(np.mean(finite))
    if len(finite) == 1:
        return MeanInterval(1, mean)
    deviation = float(np.std(finite, ddof=1))
    return MeanInterval(len(finite), mean, student_t_quantile(0.975, len(finite) - 1) * deviation / math.sqrt(len(finite)))


def paired_difference(values: Sequence[float], references: Sequence[float]) -> MeanInterval:
    """Of what is left of the first after the second, one by one."""
    return mean_interval([a - b for a, b in zip(values, references)])


def median_interval(values: Sequence[float], confidence: float = 0.95) -> tuple[float, float]:
    """The two order statistics that contain the median of whatever distribution with this confidence: the k-th from either end,
    with the largest k for which at most k - 1 of n tosses of a coin are heads with probability (1 - confidence) / 2. The ends
    where there are too few values, NaN of nothing."""
    n = len(values)
    if n == 0:
        return NONE, NONE
    rank, below = 0, 0.0
    while (below := below + math.comb(n, rank) / 2.0 ** n) <= (1.0 - confidence) / 2.0:
        rank += 1
    rising = sorted(values)
    return rising[max(rank - 1, 0)], rising[n - max(rank, 1)]


def value_at(x: Sequence[float], y: Sequence[float], place: float) -> float:
    """The curve through the points whose x is larger than all before; NaN beyond its ends."""
    rising: dict[float, float] = {}
    for a, b in zip(x, y):
        if math.isfinite(a) and math.isfinite(b) and a >= max(rising, default=-math.inf):
            rising[a] = b
    return float(np.interp(place, list(rising), list(rising.values()), left=NONE, right=NONE)) if rising else NONE
