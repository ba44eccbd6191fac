# SPDX-License-Identifier: BSD-3-Clause
"""Builds the Python package with CMake: libraries, plugins and module, for a wheel that has them all.

    pip install --no-build-isolation .    with Debian's cmake, python3-pybind11, python3-wheel and what README.md lists

Options for CMake go in the environment variable CMAKE_ARGS, such as CMAKE_ARGS=-DCMAKE_CXX_COMPILER=clang++.
"""
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pybind11
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCE = Path(__file__).resolve().parent


def version():
    """That of the project, from its CMakeLists.txt."""
    text = (SOURCE / "CMakeLists.txt").read_text(encoding="utf-8")
    return re.search(r"project\(cairn VERSION ([0-9.]+)", text).group(1)


class CMakeBuild(build_ext):
    """Configures, builds and installs with CMake, and takes over what a wheel needs."""

    def build_extension(self, ext):
        build = SOURCE / "build" / "pip"
        prefix = (Path(self.build_temp) / "prefix").resolve()
        shutil.rmtree(prefix, ignore_errors=True)
        # In the wheel everything lies below the package: module, libraries in lib/, plugins in lib/cairn/.
        configure = [
            "cmake", "-S", str(SOURCE), "-B", str(build), "-DCMAKE_BUILD_TYPE=Release", "-DCAIRN_TESTS=OFF",
            "-DCAIRN_PYTHON=ON", f"-DPython_EXECUTABLE={sys.executable}", f"-Dpybind11_DIR={pybind11.get_cmake_dir()}",
            "-DCAIRN_PYTHON_INSTALL_FOLDER=package", "-DCMAKE_INSTALL_LIBDIR=package/cairn/lib",
        ]
        if not (build / "CMakeCache.txt").exists() and shutil.which("ninja"):
            configure += ["-G", "Ninja"]
        subprocess.run(configure + shlex.split(os.environ.get("CMAKE_ARGS", "")), check=True)
        subprocess.run(["cmake", "--build", str(build), "--parallel", str(self.parallel or os.cpu_count() or 1)], check=True)
        subprocess.run(["cmake", "--install", str(build), "--prefix", str(prefix), "--strip"], check=True)
        self.take_over(prefix / "package" / "cairn", Path(self.get_ext_fullpath(ext.name)).resolve().parent)

    @staticmethod
    def take_over(installed, package):
        """Copies the package. A wheel has no symbolic links, so each library goes under the one name that is linked against."""
        (package / "lib").mkdir(parents=True, exist_ok=True)
        for file in installed.iterdir():
            if file.is_file():
                shutil.copy(file, package)
        shutil.copytree(installed / "plot", package / "plot", dirs_exist_ok=True)
        for library in (installed / "lib").glob("lib*.so.*"):  # a link, lib*.so.0.1, and the file that it names
            if library.is_symlink() and not library.name.startswith("libcairn_program"):
                shutil.copy(library, package / "lib")
        # Commands are of the program, which is not in the wheel.
        shutil.copytree(installed / "lib" / "cairn", package / "lib" / "cairn", dirs_exist_ok=True,
                        ignore=shutil.ignore_patterns("commands.*", "*_commands.*", "generate_command.*"))


if __name__ == "__main__":
    setup(version=version(), packages=[], ext_modules=[Extension("cairn._cairn", sources=[])], cmdclass={"build_ext": CMakeBuild})
