# SPDX-License-Identifier: BSD-3-Clause
"""Medians, quantiles, means of ratios and exponents of growth; NaN where there is too little to say."""
from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def ratio(value: float, reference: float) -> float:
    """NaN of nothing."""
    return value / reference if reference != 0.0 else math.nan


def median(values: Sequence[float]) -> float:
    """The middle value, or the mean of the two in the middle."""
    return float(np.median(values)) if len(values) else math.nan


def percentile(values: Sequence[float], part: float) -> float:
    """The smallest value that a part of them does not exceed."""
    return float(np.quantile(values, part, method="inverted_cdf")) if len(values) else math.nan


def geometric_mean(ratios: Sequence[float]) -> float:
    """exp of the mean logarithm: what ratios are averaged by, so that a/b and b/a agree."""
    return float(np.exp(np.mean(np.log(ratios)))) if len(ratios) else math.nan


def fitted_exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """The exponent p of the law y = c xᵖ that fits best: linear least squares on the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0]) if len(x) > 1 else math.nan
