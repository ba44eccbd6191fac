// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/conformance/checker.hpp"

namespace cairn::conformance {

/// Of an estimator: an update that fails while a factor is evaluated leaves it as it was.
void check_failing_updates(const Subject& subject, Checker& check);

}  // namespace cairn::conformance
