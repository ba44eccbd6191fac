# SPDX-License-Identifier: BSD-3-Clause
"""The same floor turned or mirrored: a map of its own, on which a method has not been tuned."""
from __future__ import annotations

from pathlib import Path

from ...data_sets import DataSet
from ...study import Bench

VIEWS = ["as it is", "17°", "31°", "73°", "mirrored"]
UNKNOWN = 205  # of a pixel


def viewed(bench: Bench, floor: DataSet, view: str) -> DataSet:
    """The floor turned about its corner, counterclockwise, or mirrored: a map of its own."""
    if view == "as it is" or floor.graph.startswith("@"):
        return floor
    from PIL import Image, ImageOps  # tables are made without it
    settings = dict(line.split(":", 1) for line in Path(floor.graph).read_text(encoding="utf-8").splitlines() if ":" in line)
    image = Image.open(Path(floor.graph).parent / settings["image"].strip()).convert("L")
    if view == "mirrored":
        changed = ImageOps.mirror(image)
    else:
        changed = image.rotate(float(view.rstrip("°")), Image.NEAREST, expand=True, fillcolor=UNKNOWN)
    name = f"{floor.name}_{view.rstrip('°')}"
    changed.save(bench.cairn.work / f"{name}.png")
    settings["image"] = f" {name}.png"
    made = bench.cairn.work / f"{name}.yaml"
    made.write_text("".join(f"{key}:{value}\n" for key, value in settings.items()), encoding="utf-8")
    return DataSet(f"{floor.name}, {view}", str(made))
