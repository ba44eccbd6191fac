# SPDX-License-Identifier: BSD-3-Clause
"""The package's type hints agree with its code."""
import importlib.util
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path


class TypesTest(unittest.TestCase):
    @unittest.skipUnless(importlib.util.find_spec("mypy"), "there is no module mypy (python3-mypy)")
    def test_mypy_finds_nothing(self):
        with tempfile.TemporaryDirectory() as cache:
            ended = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", "--cache-dir", cache,
                                    "-p", "bench"], cwd=Path(__file__).resolve().parents[2] / "tools", text=True,
                                   capture_output=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stdout + ended.stderr)
