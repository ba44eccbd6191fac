# SPDX-License-Identifier: BSD-3-Clause
# A robot that explores: maps of floors, scans and their matching, planning, explorers.
set(CAIRN_SUBJECT exploration)
set(CAIRN_SUBJECT_NEEDS compact)
