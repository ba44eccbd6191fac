// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "cairn/policy/policy_run.hpp"

namespace cairn {

/// Adds odometry where a recording has none from a pose to the next by id, but other measurements
/// lead from one to the other: the relative pose along the way whose covariances have the smallest
/// sum of traces, of the factor type of its first measurement. Its standard deviations are ten
/// times those of the way, since these measurements are used again. Nothing is added where there is
/// no way, or before `begin`.
std::vector<OdometryGap> bridge_gaps(Graph& recording, std::optional<Id> begin);

}  // namespace cairn
