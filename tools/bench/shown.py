# SPDX-License-Identifier: BSD-3-Clause
"""What the pages have of long tables: the columns and rows that their conclusions rest on. All else is in docs/data."""
from __future__ import annotations

from collections.abc import Callable

from .data import Row, Shown


def those(column: str, *values: str) -> Callable[[Row], bool]:
    return lambda row: row[column] in values


def but(column: str, *values: str) -> Callable[[Row], bool]:
    return lambda row: row[column] not in values


def a_quarter(row: Row) -> bool:
    """Of the loop closures, "489 of 1954"."""
    kept, of = (int(number) for number in row["loop closures"].split(" of "))
    return 0.2 < kept / of < 0.3


COMPARED = ["manhattanOlson3500", "city10000", "intel1728", "killian5489", "kitti_00", "sphere2500", "torus3D", "parking-garage",
            "**published, geometric mean**", "**generated, geometric mean**"]
TIMES = ["`cholmod` / ours", "`ceres` / ours"]
THESIS = ["loop closures", "map entropy [nats·m²]", "trajectory entropy [nats]", "of the floor seen [m²]", "ATE [m]", "collisions",
          "time of a run [s]", "map error at equal coverage [m²], less frontier's",
          "wrong cells, as much floor seen [m²], less frontier's"]
MEASURES = Shown(rows=those("mean ± 95 % (thesis)", *THESIS))
VERDICTS = Shown(["claim", "seen?"])
COVERED = ["seen, differential", "seen, holonomic", "seen, dubins", "finished", "of them below 95 %", "collisions", "ATE [m]: median",
           "largest"]
EVERYDAY = ["pose2d/M3500.g2o", "pose2d/M3500c.graph", "pose2d/city10000.g2o", "pose2d/intel1728.g2o", "pose2d/kitti_00.g2o",
            "pose3d/sphere2500.g2o", "pose3d/torus3D.g2o.gz", "pose3d/parking-garage.g2o"]
LINK = Shown(rows=lambda row: False)

# Of each table of a section.
SHOWN: dict[str, list[Shown]] = {
    "graphs-1": [Shown(["graph", "ours [ms]", *TIMES, "peak memory [MB]"], those("graph", *COMPARED))],
    "graphs-2": [Shown(["graph", *TIMES], those("graph", *COMPARED[-2:]))],
    "parts": [LINK],
    "rates": [Shown(["graph", "factorise [ms]", "GFLOP/s", "of `dgemm`", "of the roof"])],
    "precision": [Shown(["graph", "flops per nonzero", "faster"], those("graph", "manhattanOlson3500", "city10000", "sphere2500",
                                                                         "torus3D", "grid3d 12³", "**geometric mean**"))],
    "threads": [Shown(["graph", "factorise: faster", "iteration: faster"])],
    "marginals": [Shown(["graph", "variables", "analyse, factorise [ms]", "diagonal [ms]", "both [ms]", "both, 2 threads [ms]", "faster"],
                        those("graph", *COMPARED))],
    "online-times": [Shown(["graph", "steps", "ours [s]", "median step [ms]", "99 %", "longest",
                            "`periodic_batch` / ours", "`batch` / ours"])],
    "online-chi2": [Shown(["graph", "above batch", "at most, at the samples", "finished", "`periodic_batch` above batch"])],
    "online-marginals": [Shown(["graph", "all [s]", "without [s]", "covariances", "99 %", "longest"])],
    "online-budget": [LINK],
    "compact-every": [Shown(["graph", "poses kept", "distance [m]", "KLD [nats]", "left out", "time [s]"], those("graph", *EVERYDAY))],
    "compact-times": [Shown(["graph", "thresholds", "faster", "loops kept", "poses kept"], but("thresholds", "as published"))],
    "compact-errors": [Shown(["graph", "strategy", "ATE [m]", "ATE over APAL's"],
                             those("strategy", "FPFL", "the paper's FPFL"))],
    "compact-live": [Shown(["graph", "poses kept", "of", "loops kept", "ATE [m]", "random: ATE [m]", "odometry: ATE [m]"])],
    "compact-growth": [LINK, LINK],
    "compact-million": [Shown(["poses driven", "poses kept", "memory [MB]", "median step [ms]", "99 %", "ATE of the poses kept [m]"])],
    "compact-matches": [Shown(["graph", "gate", "registered, false", "loops kept, false", "poses kept", "ATE [m]",
                               "over clean"], those("false matches", "10 %"))],
    "sparsify-topologies": [Shown(["recorded", "problems", *(f"KLD: `{of}`" for of in ["mi", "dmi", "ekld", "odd", "l1"])],
                                  those("nodes", "all"))],
    "sparsify-problems": [LINK, LINK],
    "sparsify-regularization": [LINK],
    "sparsify-space": [Shown(["graph", "topology", "poses", "factors", "largest", "KLD", "aligned RMSE [m]", "time [s]"], those("N", "4"))],
    "sparsify-large": [Shown(["graph", "removed", "poses", "factors", "KLD", "aligned RMSE [m]", "time [s]"])],
    "sparsify-every": [Shown(["graph", "poses", "factors", "largest blanket", "KLD", "aligned RMSE [m]", "time [s]"],
                             those("graph", *EVERYDAY))],
    "sparsify-online": [Shown(["graph", "late factors are redirected", "KLD", "RMSE from all measurements [m]", "median step [ms]",
                               "longest"])],
    "sparsify-selection": [Shown(["selection", "poses", "factors", "largest", "KLD", "aligned RMSE [m]", "selecting [s]", "removal [s]"])],
    "sparsify-edges-kld": [Shown(rows=a_quarter)],
    "explore-default": [Shown(["floor", "runs", *COVERED])],
    "explore-others": [Shown(["method", "runs", *COVERED])],
    "explore-exact": [Shown(["floor", "end", "driven [m]", "of what the body can cover", "collisions"])],
    "explore-warehouse": [LINK],
    **{f"explore-{part}": [MEASURES] for part in ["cave", "freiburg", "action", "scale"]},
    **{f"explore-{part}-claims": [VERDICTS] for part in ["cave", "freiburg", "action", "scale"]},
    "explore-elsewhere-claims": [Shown()],
}
