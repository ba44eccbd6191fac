# SPDX-License-Identifier: BSD-3-Clause
"""The type stubs name what is there, and everything public has a docstring."""
import importlib.util
import inspect
import os
import subprocess
import sys
from pathlib import Path

import pytest

import cairn


@pytest.mark.skipif(not importlib.util.find_spec("mypy"), reason="there is no module mypy (package mypy)")
def test_stubs_and_module_agree(tmp_path):
    environment = dict(os.environ, MYPYPATH=str(Path(cairn.__file__).parent.parent))
    settings = tmp_path / "mypy.ini"
    settings.write_text("[mypy]\nignore_missing_imports = True\n")  # matplotlib of Debian 12 has no types
    ended = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "cairn", "--ignore-missing-stub", "--concise", "--mypy-config-file", str(settings)],
        capture_output=True, text=True, cwd=tmp_path, env=environment,
    )
    # What pybind11 makes has a metaclass, and where nothing makes an object, a constructor that refuses.
    harmless = ("metaclass differs", '.__init__ is inconsistent, stub does not have *args argument "args"')
    own = "cairn.plot._"  # these have types of their own, no stubs
    found = [line for line in ended.stdout.splitlines() if not line.endswith(harmless) and not line.startswith(own)]
    assert not found and ended.returncode in (0, 1), ended.stdout + ended.stderr


@pytest.mark.skipif(not importlib.util.find_spec("mypy"), reason="there is no module mypy (package mypy)")
def test_a_program_is_checked_with_them(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        "import cairn\n"
        "graph = cairn.read('map.g2o')\n"
        "summary = cairn.optimize(graph, 'dogleg', linear_solver='cholmod', max_iterations=50)\n"
        "reveal_type(summary.chi2)\n"
        "graph.add(1, cairn.Pose2(1, 2))\n"
        "class Own:\n"
        "    def decide(self, now: cairn.Situation) -> cairn.Decision:\n"
        "        return cairn.Decision.drive(now.centres([1, 2]), 'there')\n"
        "floor = cairn.generate_floor('rooms')\n"
        "cairn.explore(floor, Own(), max_distance=3)\n"
        "cairn.explore(floor, lambda now: cairn.Decision.finished())\n"
        "cairn.explore(floor, Own)\n"
    )
    environment = dict(os.environ, MYPYPATH=str(Path(cairn.__file__).parent.parent))
    ended = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--cache-dir", str(tmp_path), str(program)],
        capture_output=True, text=True, cwd=tmp_path, env=environment,
    )
    lines = [line for line in ended.stdout.splitlines() if line.startswith("program.py:")]
    assert 'program.py:4: note: Revealed type is "builtins.float"' in lines, ended.stdout
    assert any(line.startswith("program.py:5: error: No overload variant") for line in lines), ended.stdout
    assert {line.split(":")[1] for line in lines if ": error: " in line} == {"5", "12"}, ended.stdout  # a class is no explorer


def public(owner):
    return {name: member for name, member in vars(owner).items() if not name.startswith("_")}


def test_everything_public_is_documented():
    assert set(cairn.__all__) - {"__version__"} <= set(public(cairn))
    for name in cairn.__all__:
        thing = getattr(cairn, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(thing), name
