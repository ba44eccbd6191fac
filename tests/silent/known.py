# SPDX-License-Identifier: BSD-3-Clause
"""The graphs of a folder of data, with other states and fewer measurements."""
from __future__ import annotations

import functools
import os
from typing import List

import numpy as np

import cairn
from worlds import World, with_few_loops, with_gaps, with_other_states, with_scaled_information, with_shuffled_ids

"""Large graphs are left out: what matters is the number of different ones."""
MOST_VARIABLES = 4000
FOLDERS = ("pose2d", "pose3d", "landmark2d")


@functools.lru_cache(maxsize=None)
def known_graphs(folder: str) -> List[str]:
    files = []
    for part in FOLDERS:
        path = os.path.join(folder, part)
        if folder and os.path.isdir(path):
            files += sorted(os.path.join(path, name) for name in os.listdir(path))
    return files


def known_world(folder: str, seed: int) -> World:
    """The truth of a known graph is unknown: its minimum from the default start stands for it."""
    rng = np.random.default_rng([seed, 99])
    files = known_graphs(folder)
    for _ in range(100):
        file = files[int(rng.integers(len(files)))]
        try:
            graph = cairn.read(file, repair_information=True)
        except cairn.Error:
            continue
        if graph.variable_count <= MOST_VARIABLES:
            break
    truth = graph.copy()
    cairn.optimize(truth)
    world = World(os.path.basename(file), graph, truth, defects=["of the real world"])
    for probability, way in ((0.3, with_gaps), (0.2, with_few_loops), (0.5, with_other_states), (0.3, with_scaled_information), (0.2, with_shuffled_ids)):
        if rng.uniform() < probability:
            way(rng, world)
    return world
