#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""An explorer written in Python: it drives to the frontier that takes the shortest drive.

    python3 nearest_frontier.py [floor.yaml] [--seed 1]

Without a file, a building is generated.
"""
import argparse

import cairn


class NearestFrontier:
    """Frontiers shorter than `smallest` [m] are left."""

    def __init__(self, smallest=0.5):
        self.smallest = smallest

    def decide(self, now):
        nearest = None
        for frontier in now.frontiers:  # longest first
            if frontier.length < self.smallest:
                break
            for goal in [frontier.middle, *now.centres(frontier.cells[2::5])]:
                path = now.path_to(goal)
                if path is None or path.length < now.resolution:  # it is there already, or as near as it can come
                    continue
                if nearest is None or path.length < nearest.length:
                    nearest = path
        if nearest is None:
            return cairn.Decision.finished(f"no frontier of {self.smallest} m or more is left that can be reached")
        return cairn.Decision.drive(nearest, f"to the nearest frontier, {nearest.length:.1f} m away")


if __name__ == "__main__":
    cli = argparse.ArgumentParser(description="explores a floor, frontier by frontier")
    cli.add_argument("floor", nargs="?")
    cli.add_argument("--seed", type=int, default=1)
    given = cli.parse_args()
    floor = cairn.read_floor(given.floor) if given.floor else cairn.generate_floor("rooms", seed=3, width=12, height=10)
    run = cairn.explore(floor, NearestFrontier(), seed=given.seed)
    print(f"{run.end}: {run.why}; {run.steps['distance'][-1]:.1f} m driven, {run.steps['coverage'][-1]:.1f} m^2 known")
