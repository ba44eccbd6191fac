# SPDX-License-Identifier: BSD-3-Clause
# Simulated graphs with ground truth, the same on every machine.
set(CAIRN_SUBJECT generate)
set(CAIRN_SUBJECT_NEEDS)
