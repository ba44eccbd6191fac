# SPDX-License-Identifier: BSD-3-Clause
# Starting values for graphs that have none, or poor ones.
set(CAIRN_SUBJECT initial)
set(CAIRN_SUBJECT_NEEDS)
