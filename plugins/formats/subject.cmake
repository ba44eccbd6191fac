# SPDX-License-Identifier: BSD-3-Clause
# Files of graphs.
set(CAIRN_SUBJECT formats)
set(CAIRN_SUBJECT_NEEDS)
