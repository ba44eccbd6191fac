# SPDX-License-Identifier: BSD-3-Clause
"""What `pip install .` builds, as far as that can be told without building it."""
import importlib.util
from pathlib import Path

import pytest

import cairn

SOURCE = Path(__file__).resolve().parents[2]


def setup_module_of_the_project():
    pytest.importorskip("setuptools")
    pytest.importorskip("pybind11", reason="there is no module pybind11 (python3-pybind11)")
    spec = importlib.util.spec_from_file_location("project_setup", SOURCE / "setup.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_version_is_that_of_the_library():
    assert setup_module_of_the_project().version() == cairn.__version__


def test_a_wheel_gets_module_libraries_and_plugins_once(tmp_path):
    installed, package = tmp_path / "installed", tmp_path / "package"
    (installed / "lib" / "cairn" / "report").mkdir(parents=True)
    (installed / "lib" / "cmake").mkdir()
    (installed / "plot").mkdir()
    for name in ["__init__.py", "_cairn.so", "plot/__main__.py", "lib/libcairn.so.0.1.0", "lib/cairn/dogleg.so", "lib/cairn/dogleg.json", "lib/cairn/report/page.html"]:
        (installed / name).write_text(name)
    (installed / "lib" / "libcairn.so.0.1").symlink_to("libcairn.so.0.1.0")
    (installed / "lib" / "libcairn.so").symlink_to("libcairn.so.0.1")
    setup_module_of_the_project().CMakeBuild.take_over(installed, package)
    files = {str(file.relative_to(package)) for file in package.rglob("*") if file.is_file()}
    assert files == {
        "__init__.py", "_cairn.so", "plot/__main__.py", "lib/libcairn.so.0.1", "lib/cairn/dogleg.so", "lib/cairn/dogleg.json",
        "lib/cairn/report/page.html",
    }
    assert not (package / "lib" / "libcairn.so.0.1").is_symlink()
