# SPDX-License-Identifier: BSD-3-Clause
"""cairn: a back end for graph SLAM.

    import cairn

    graph = cairn.read("map.g2o")
    print(cairn.optimize(graph, "dogleg", linear_solver="cholmod"))
    graph.write("optimized.g2o")

Lengths are metres, angles radians. Solvers, formats, losses and types are plugins chosen by name: `cairn.kinds()` and
`cairn.components(kind)` list them. Whatever cannot be done raises `cairn.Error`, whose message says what would work.
"""
from ._cairn import (
    BearingRange,
    Between,
    Component,
    Error,
    Estimator,
    FactorType,
    Graph,
    Iteration,
    L,
    Measurement,
    Observation,
    Option,
    Point2,
    Point3,
    Pose2,
    Pose3,
    Prior,
    Rot3,
    Summary,
    TrajectoryError,
    UpdateReport,
    X,
    __version__,
    components,
    cross_covariances,
    draw,
    evaluate,
    generate,
    id_text,
    kinds,
    marginals,
    optimize,
    read,
    register,
    set_threads,
    spec,
    symbol,
    write,
)
from . import _plot  # noqa: E402,F401  plots are methods of Graph

__all__ = [
    "BearingRange",
    "Between",
    "Component",
    "Error",
    "Estimator",
    "FactorType",
    "Graph",
    "Iteration",
    "L",
    "Measurement",
    "Observation",
    "Option",
    "Point2",
    "Point3",
    "Pose2",
    "Pose3",
    "Prior",
    "Rot3",
    "Summary",
    "TrajectoryError",
    "UpdateReport",
    "X",
    "__version__",
    "components",
    "cross_covariances",
    "draw",
    "evaluate",
    "generate",
    "id_text",
    "kinds",
    "marginals",
    "optimize",
    "read",
    "register",
    "set_threads",
    "spec",
    "symbol",
    "write",
]

# They are the package's, wherever they are compiled.
for _name in __all__:
    if isinstance(globals()[_name], type):
        globals()[_name].__module__ = "cairn"
