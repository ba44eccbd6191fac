# SPDX-License-Identifier: BSD-3-Clause
# The interpreter of the Python package, which draws plots too, and where the package is in the build and below the prefix.

# Debian's interpreter, if there is one and no other is named: its pybind11 and NumPy are packages like all others.
if(NOT DEFINED Python_EXECUTABLE AND EXISTS /usr/bin/python3)
  set(Python_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "The interpreter that the package cairn is built for")
endif()
find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module)
if(Python_FOUND)
  set(PYBIND11_FINDPYTHON ON)
  find_package(pybind11 2.9 QUIET)
endif()

set(CAIRN_PYTHON_FOLDER ${CMAKE_BINARY_DIR}/python)  # PYTHONPATH of the package in the build
# Where Debian's interpreter looks.
set(CAIRN_PYTHON_INSTALL_FOLDER lib/python3/dist-packages CACHE STRING "Where cmake --install puts the package cairn")
