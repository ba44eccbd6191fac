# SPDX-License-Identifier: BSD-3-Clause
"""Measures the program `cairn`, study by study, and writes what it found into the pages of docs/: see `./dev help`.

A study runs processes of `cairn`, keeps what they report in a JSON file of its own, and makes tables of that file. So
tables can be written again without measuring. Nothing here computes what is measured: numbers are those that `cairn`
reports, and medians, ratios and fits of them.
"""
