# SPDX-License-Identifier: BSD-3-Clause
"""Type hints of what ./dev calls agree with the code; tests/bench has its own test of them."""
import importlib.util
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
PLACES = ["tools/dev", "tools/lint", "tools/docs/build_site.py", "tools/docs/gallery.py", "tests/fuzz/search.py"]


class Types(unittest.TestCase):
    @unittest.skipUnless(importlib.util.find_spec("mypy"), "there is no module mypy (python3-mypy)")
    def test_mypy_finds_nothing(self):
        with tempfile.TemporaryDirectory() as cache:
            ended = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--cache-dir", cache, *PLACES], cwd=SOURCE,
                                   text=True, capture_output=True, check=False)
        self.assertEqual(ended.returncode, 0, ended.stdout + ended.stderr)


if __name__ == "__main__":
    unittest.main()
