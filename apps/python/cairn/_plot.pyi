# SPDX-License-Identifier: BSD-3-Clause
from typing import Any, Optional

from . import Graph as Graph
from . import draw as draw

def plot(self: Graph, ax: Any = ..., *, color: Any = ..., label: Optional[str] = ..., factors: bool = ...) -> Any: ...
def _repr_html_(self: Graph) -> Optional[str]: ...
