# SPDX-License-Identifier: BSD-3-Clause
"""The studies: each module measures, and makes tables of what was measured."""
from __future__ import annotations

from ..study import Study
from . import compact, explore, graphs, marginals, minimum, online, precision, rates, scaling, solvers, sparsify

ALL: list[Study] = [*graphs.STUDIES, *rates.STUDIES, *precision.STUDIES, *scaling.STUDIES, *solvers.STUDIES, *minimum.STUDIES,
                    *marginals.STUDIES, *online.STUDIES, *compact.STUDIES, *sparsify.STUDIES, *explore.STUDIES]
