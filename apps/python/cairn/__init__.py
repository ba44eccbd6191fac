# SPDX-License-Identifier: BSD-3-Clause
"""cairn: a back end for graph SLAM.

    import cairn

    graph = cairn.read("map.g2o")
    print(cairn.optimize(graph, "dogleg", linear_solver="cholmod"))
    graph.write("optimized.g2o")

Lengths are metres, angles radians. Solvers, formats, losses and types are plugins chosen by name: `cairn.kinds()` and
`cairn.components(kind)` list them. Whatever cannot be done raises `cairn.Error`, whose message says what would work; it is
a `FileNotFoundError`, a `KeyError` (of ids) or a `ValueError` as well where it is one.
"""
from . import _cairn
from ._cairn import *  # noqa: F401,F403  what the module has: that of each subject which was built
from ._cairn import __version__
from . import plot
from ._plot import draw  # instead of the module's, which draws nothing by matplotlib

__all__ = [*sorted(_name for _name in dir(_cairn) if not _name.startswith("_")), "plot", "__version__"]

# They are the package's, wherever they are compiled.
for _name in __all__:
    if isinstance(globals()[_name], type):
        globals()[_name].__module__ = "cairn"
