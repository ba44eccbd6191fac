// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/conformance/checker.hpp"

namespace cairn::conformance {

/// That residuals which are angles are wrapped: along a full turn of each variable that turns, and
/// along lines in its other directions, no row jumps by 2π but from π to −π or back.
void check_wrapping(const Subject& subject, Checker& check);

}  // namespace cairn::conformance
