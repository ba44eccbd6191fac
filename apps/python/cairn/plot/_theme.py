# SPDX-License-Identifier: BSD-3-Clause
"""Colours and strokes of docs/report.md, which the page of `cairn view` has too."""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Union

PIXEL = 0.75  # [pt]: 72 points, 96 pixels an inch
TEXT, TITLE = 11 * PIXEL, 14 * PIXEL  # [pt]

Colour = Union[str, "tuple[float, float, float]"]


@dataclass(frozen=True)
class Stroke:
    """How a line looks. Width and dashes (on, off, …) are pixels."""

    colour: Colour
    width: float = 1.0
    dash: tuple[float, ...] = ()
    alpha: float = 1.0

    def line(self) -> dict[str, Any]:
        """Arguments of a matplotlib line; dashes are as they say where "lines.scale_dashes" is False."""
        style = (0, tuple(part * PIXEL for part in self.dash)) if self.dash else "solid"
        return {"color": self.colour, "linewidth": self.width * PIXEL, "linestyle": style, "alpha": self.alpha,
                "solid_capstyle": "butt"}

    def thinner(self, factor: float) -> Stroke:
        return replace(self, width=self.width * factor)


@dataclass(frozen=True)
class Theme:
    """What is drawn in which colour, on paper of which."""

    paper: str
    ink: str
    muted: str
    grid: str
    roles: dict[str, Stroke]
    loop: Stroke
    landmark: Stroke
    peers: tuple[Stroke, ...]
    ramp: tuple[str, ...]  # residuals, from least to worst

    def peer(self, number: int) -> Stroke:
        return self.peers[number % len(self.peers)]

    def series(self, number: int) -> Stroke:
        """Of the first line of a chart, the second, …"""
        return self.peer(number - 1) if number else self.roles["estimate"]

    def residual(self, part: float) -> tuple[float, float, float]:
        """The colour at a part of the ramp, 0 to 1."""
        from matplotlib.colors import to_rgb

        place = min(max(part, 0.0), 1.0) * (len(self.ramp) - 1)
        k = min(int(place), len(self.ramp) - 2)
        a, b = to_rgb(self.ramp[k]), to_rgb(self.ramp[k + 1])
        red, green, blue = (x + (place - k) * (y - x) for x, y in zip(a, b))
        return red, green, blue


def _theme(dark: bool) -> Theme:
    def pick(on_light: str, on_dark: str) -> str:
        return on_dark if dark else on_light

    return Theme(
        paper=pick("#fcfcfb", "#14171b"),
        ink=pick("#1a1d21", "#e8eaed"),
        muted=pick("#5c636d", "#a3aab4"),
        grid=pick("#e4e5e3", "#262b31"),
        roles={
            "initial": Stroke(pick("#8a8f98", "#8a919c"), 1, (1, 2)),
            "estimate": Stroke(pick("#0072b2", "#56b4e9"), 2),
            "truth": Stroke(pick("#1a1d21", "#f2f4f7"), 1, (6, 4)),
        },
        loop=Stroke("#e69f00", 1, (), 0.55),
        landmark=Stroke(pick("#009e73", "#2fc79a"), 0.75, (), 0.45),
        peers=(
            Stroke(pick("#d55e00", "#ff8a3d"), 1.5, (6, 3)),
            Stroke(pick("#009e73", "#2fc79a"), 1.5, (2, 2)),
            Stroke(pick("#cc79a7", "#e6a3c8"), 1.5, (8, 3, 2, 3)),
            Stroke(pick("#56b4e9", "#9ad4f5"), 1.5, (12, 4)),
            Stroke(pick("#b8860b", "#e0b83c"), 1.5, (4, 2, 1, 2)),
        ),
        ramp=(
            pick("#d5d8dc", "#3a424d"), pick("#f0c987", "#7a4a5e"), pick("#e58a2c", "#c2552f"),
            pick("#b8430e", "#f09a2e"), pick("#5c0a12", "#ffe9a8"),
        ),
    )


THEMES = {"light": _theme(False), "dark": _theme(True)}
