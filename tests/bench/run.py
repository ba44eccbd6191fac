# SPDX-License-Identifier: BSD-3-Clause
"""Runs the tests of this folder; ends with 77, which is "skipped", where a module is missing."""
import importlib
import sys
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
for module in ["pandas", "tabulate"]:
    try:
        importlib.import_module(module)
    except ImportError:
        print(f"skipped: there is no module {module} (python3-{module}) for {sys.executable}")
        sys.exit(77)

sys.path[:0] = [str(HERE), str(HERE.parents[1] / "tools")]
unittest.main(module=None, argv=[sys.argv[0], "discover", "-s", str(HERE), *sys.argv[1:]])
