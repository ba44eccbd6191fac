# SPDX-License-Identifier: BSD-3-Clause
import os
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy.typing as npt

from .. import Graph, Summary

__all__: List[str]

_Report = Union[Dict[str, Any], str, "os.PathLike[str]"]

def trajectory(
    graphs: Union[Graph, Dict[str, Graph]],
    ax: Any = ...,
    *,
    truth: Optional[Graph] = ...,
    covariances: Optional[Dict[str, Tuple[npt.ArrayLike, npt.ArrayLike]]] = ...,
    colour: str = ...,
    poses: bool = ...,
    ellipses: Optional[float] = ...,
    theme: str = ...,
) -> Any: ...
def sparsity(graph: Graph, axes: Optional[Sequence[Any]] = ..., *, linear_solver: str = ..., theme: str = ...) -> Tuple[Any, ...]: ...
def convergence(runs: Mapping[str, Union[Summary, _Report]], ax: Any = ..., *, x: str = ..., theme: str = ...) -> Any: ...
def steps(runs: Mapping[str, Union[Summary, _Report]], ax: Any = ..., *, theme: str = ...) -> Any: ...
def columns(
    tables: Mapping[str, Mapping[str, npt.ArrayLike]],
    ax: Any = ...,
    *,
    x: str = ...,
    y: str = ...,
    x_max: Optional[float] = ...,
    log: str = ...,
    theme: str = ...,
) -> Any: ...
def bars(report: _Report, ax: Any = ..., *, graph: int = ..., theme: str = ...) -> Any: ...
def scaling(report: _Report, ax: Any = ..., *, memory: bool = ..., theme: str = ...) -> Any: ...
def exploration(
    recording: Union[str, "os.PathLike[str]", Sequence[Dict[str, Any]]],
    ax: Any = ...,
    *,
    decision: Optional[int] = ...,
    ellipses: float = ...,
    theme: str = ...,
) -> Any: ...
