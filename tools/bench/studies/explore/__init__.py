# SPDX-License-Identifier: BSD-3-Clause
"""Explorers on real floors, as in Tables 5.4 to 5.6 of Vallvé (2018) and beyond: docs/explore_results.md has the tables."""
from __future__ import annotations

from ...study import Study
from . import cover, floors, thesis

STUDIES: list[Study] = [*thesis.STUDIES, *cover.STUDIES, *floors.STUDIES]
