# SPDX-License-Identifier: BSD-3-Clause
# What the core needs. A plugin finds its own dependency in its own folder, and is left out with one line
# where that is missing. docs/dependencies.md says what each is for.

find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(Boost 1.75 REQUIRED COMPONENTS json)
find_package(TBB REQUIRED)
find_package(fmt REQUIRED)
find_package(ZLIB REQUIRED)
