// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/graph/graph.hpp"

namespace cairn {

/// A sentence where a few cameras and points, as at the graph's states, have another minimum with a
/// lower chi2 within what their measurements leave uncertain. With hardly more measurements than
/// unknowns such minima are beside each other, and chi2 is plausible in each. Looked for from one
/// and three standard deviations to either side along the three directions that are determined
/// worst. Empty where there is none, and where there are more than 100 unknowns, at least twice as
/// many measurements, or no component whose gauge is left free: then it costs a count of the
/// variables; and where all measurements fit exactly.
std::string lower_minimum_nearby(const Graph& graph, double chi2);

}  // namespace cairn
