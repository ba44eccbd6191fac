// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/runtime/api.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

/// How an update ended whose estimator has optimised all of its `factors`: sets `ok`, `converged`,
/// `iterations` and `owed` of the report. What a limit of time has cut short counts as `owed`, and
/// later updates go on with it; any other end before the minimum is none, nor is that of a full
/// update. Returns the note that gives the reason where it has not converged, else nothing.
CAIRN_API std::string report_batch_step(const Summary& summary, const Stop& stop,
                                        const UpdateOptions& options, int factors,
                                        UpdateReport& report);

}  // namespace cairn
