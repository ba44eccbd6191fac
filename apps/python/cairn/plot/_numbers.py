# SPDX-License-Identifier: BSD-3-Clause
"""The numbers of a plot out of the JSON of docs/report.md."""
from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np

ODOMETRY, LOOP, LANDMARK, PRIOR, PATH, OTHER = range(6)  # classes of edges
MOST = 100_000_000  # numbers of one array
_TYPES = {"f32": "<f4", "f64": "<f8", "i32": "<i4", "i64": "<i8", "u8": "u1", "u16": "<u2"}


class PlotError(Exception):
    """What cannot be drawn, with what would work. `code`: 2 for a wrong option, 3 for data that are not there."""

    def __init__(self, message: str, code: int = 3):
        super().__init__(message)
        self.code = code


def array(value: Any) -> np.ndarray:
    """An ARRAY or POSITIONS as numbers. Raises ValueError for what is none."""
    if isinstance(value, list):
        return np.array([np.nan if number is None else number for number in value], dtype=float)
    count = int(value["count"])
    if not 0 <= count <= MOST:
        raise ValueError("too many numbers")
    data = base64.b64decode(value["deflate"] if "deflate" in value else value["base64"], validate=True)
    kind = np.dtype(_TYPES[value["type"]])
    if "deflate" in value:
        try:
            data = zlib.decompressobj().decompress(data, count * kind.itemsize + 1)
        except zlib.error as error:
            raise ValueError(str(error)) from None
    if len(data) != count * kind.itemsize:
        raise ValueError("not as many numbers as it says")
    numbers = np.frombuffer(data, kind)
    low, high = value.get("min"), value.get("max")
    if value["type"] != "u16" or not low or not high or len(low) != len(high):
        return numbers
    steps = numbers.reshape(-1, len(low))
    least, most = np.array(low, dtype=float), np.array(high, dtype=float)
    return np.where(steps == 65535, np.nan, least + steps / 65534 * (most - least)).ravel()


@dataclass
class Estimate:
    """One set of positions of a scene's variables, (n, dimension) [m]; NaN: not there."""

    name: str
    role: str
    positions: np.ndarray
    edge_chi2: Optional[np.ndarray] = None
    covariance_variables: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    covariances: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 2)))


@dataclass
class Scene:
    """A graph: its edges from variable a to b (-1: none), and where its variables are."""

    name: str
    dimension: int
    a: np.ndarray
    b: np.ndarray
    edge_class: np.ndarray
    is_pose: np.ndarray
    estimates: list[Estimate]
    runs: list[dict[str, Any]]

    def has(self, edge_class: int) -> bool:
        return bool((self.edge_class == edge_class).any())


def _covariances(upper: np.ndarray, dimension: int) -> np.ndarray:
    """Symmetric matrices (n, d, d) of their upper triangles, row by row."""
    upper = upper.reshape(-1, dimension * (dimension + 1) // 2)
    full = np.empty((len(upper), dimension, dimension))
    rows, columns = np.triu_indices(dimension)
    full[:, rows, columns] = upper
    full[:, columns, rows] = upper
    return full


def _estimate(value: dict[str, Any], dimension: int, origin: list[float]) -> Estimate:
    positions = array(value["positions"]).astype(float).reshape(-1, dimension) + np.array(origin[:dimension], dtype=float)
    estimate = Estimate(value["name"], value["role"], positions)
    if "edge_chi2" in value:
        estimate.edge_chi2 = array(value["edge_chi2"]).astype(float)
    if "covariance" in value:
        estimate.covariance_variables = array(value["covariance"]["variable"]).astype(int)
        estimate.covariances = _covariances(array(value["covariance"]["upper"]).astype(float), dimension)
    return estimate


def scene(value: dict[str, Any]) -> Scene:
    """A GRAPH of docs/report.md."""
    dimension = value["dimension"]
    variables, edges = value["variables"], value["edges"]
    poses = np.array([kind["role"] == "pose" for kind in variables["types"]], dtype=bool)
    # What there is of runs without their graph is no estimate.
    estimates = [_estimate(one, dimension, value["origin"]) for one in value["estimates"]] if variables["count"] else []
    return Scene(value["name"], dimension, array(edges["a"]).astype(int), array(edges["b"]).astype(int),
                 array(edges["class"]).astype(int), poses[array(variables["type"]).astype(int)], estimates, value["runs"])
