# SPDX-License-Identifier: BSD-3-Clause
"""`cairn compact` on published and generated graphs: docs/compact_results.md has the tables."""
from __future__ import annotations

from ...study import Study
from . import checks, every, figures, growth, million, seeds, sensitivity, sets

STUDIES: list[Study] = [*sets.STUDIES, *sensitivity.STUDIES, *figures.STUDIES, *growth.STUDIES, *checks.STUDIES,
                        *million.STUDIES, *seeds.STUDIES, *every.STUDIES]
