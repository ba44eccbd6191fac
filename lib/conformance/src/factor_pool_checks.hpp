// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/conformance/checker.hpp"

namespace cairn::conformance {

/// `squared_norms` and `linearize` of several factors, as a graph stores them, against `evaluate`
/// of each.
void check_pools(const Subject& subject, Checker& check);

/// How long `linearize` takes beside `EDGE_SE2`: a note, never a finding, since times depend on the
/// machine and on what else it does.
void note_time(const Subject& subject, Checker& check);

}  // namespace cairn::conformance
