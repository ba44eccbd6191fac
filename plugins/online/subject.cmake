# SPDX-License-Identifier: BSD-3-Clause
# Estimation while measurements arrive: the line protocol, its journal and its server.
set(CAIRN_SUBJECT online)
set(CAIRN_SUBJECT_NEEDS)
