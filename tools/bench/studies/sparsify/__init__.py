# SPDX-License-Identifier: BSD-3-Clause
"""`cairn sparsify`, as in chapter 4 of Vallvé (2018) and beyond: docs/sparsify_results.md has the tables."""
from __future__ import annotations

from ...study import Study
from . import edges, every, problems, thesis, whole

STUDIES: list[Study] = [*thesis.STUDIES, *problems.STUDIES, *whole.STUDIES, *every.STUDIES, *edges.STUDIES]
