# SPDX-License-Identifier: BSD-3-Clause
# What is shown of graphs and runs: the page for the browser, and static plots.
set(CAIRN_SUBJECT report)
set(CAIRN_SUBJECT_NEEDS)
