# SPDX-License-Identifier: BSD-3-Clause
# Sparsification: nodes and edges are taken out of a graph, and their information stays in a few factors.
set(CAIRN_SUBJECT sparsify)
set(CAIRN_SUBJECT_NEEDS)
