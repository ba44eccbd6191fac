# SPDX-License-Identifier: BSD-3-Clause
"""Numbers as tables have them; "-" for what is not a number."""
from __future__ import annotations

import math

from .averages import ratio
from .reports import Json, median_of, number, was_late


def digits(value: float) -> str:
    """Three digits."""
    if not math.isfinite(value):
        return "-"
    return f"{value:.0f}" if abs(value) >= 99.95 else f"{value:#.3g}"


def whole(value: float) -> str:
    """"14" of 14.2."""
    return f"{value:.0f}" if math.isfinite(value) else "-"


def plain(value: float) -> str:
    """As many digits as the number has: "0.005", "25"."""
    return repr(float(value)).removesuffix(".0")


def times(factor: float) -> str:
    """"3.21 ×"."""
    return digits(factor) + " ×" if math.isfinite(factor) else "-"


def percent(part: float, decimals: int = 0) -> str:
    """"52 %" of 0.52."""
    return f"{100.0 * part:.{decimals}f} %" if math.isfinite(part) else "-"


def milliseconds(seconds: float) -> str:
    """"14.2" of 0.0142 s."""
    return digits(1e3 * seconds)


def megabytes(size: float) -> str:
    return f"{1e-6 * size:.0f}" if math.isfinite(size) and size > 0.0 else "-"


def count(value: float) -> str:
    """"1.53 M"."""
    if not math.isfinite(value):
        return "-"
    for unit, name in [(1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")]:
        if value >= unit:
            return f"{value / unit:.3g} {name}"
    return f"{value:.0f}"


def apart(value: float, reference: float, rounding: float = 0.0) -> str:
    """How far apart two numbers are, relative to the second, or to `rounding` if that is larger: "0", "3e-15"."""
    if not math.isfinite(value) or not math.isfinite(reference):
        return "-"
    return "0" if value == reference else f"{ratio(abs(value - reference), max(abs(reference), rounding)):.0e}"


def total(contestant: Json) -> str:
    """Seconds in all; "> 60" of one that was not finished."""
    return f"> {number(contestant, 'limit'):.0f}" if was_late(contestant) else digits(median_of(contestant, "seconds.total"))


def step_times(contestant: Json) -> list[str]:
    """Median, 95 %, 99 % and the longest step [ms]."""
    return [milliseconds(median_of(contestant, f"steps.{of}")) for of in ["median", "p95", "p99", "max"]]
