# SPDX-License-Identifier: BSD-3-Clause
# Compact pose SLAM: policies that keep the informative poses and loop closures, and what matches pairs of poses.
set(CAIRN_SUBJECT compact)
set(CAIRN_SUBJECT_NEEDS sparsify online)
