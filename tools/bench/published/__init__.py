# SPDX-License-Identifier: BSD-3-Clause
"""Figures of papers, in the CSV files beside this; each begins with its source and what its columns are."""
from __future__ import annotations

import functools
from pathlib import Path

import pandas as pd

from ..reports import NONE


@functools.cache
def _figures(name: str) -> pd.DataFrame:
    return pd.read_csv(Path(__file__).with_name(f"{name}.csv"), comment="#")


def said(name: str, column: str, **row: str | int) -> float:
    """The figure of a file in a column, of the row that has these values; NaN if it does not say."""
    rows = _figures(name)
    for key, value in row.items():
        rows = rows[rows[key] == value]
    return float(rows[column].iloc[0]) if len(rows) else NONE
