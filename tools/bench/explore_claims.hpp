// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "compared_runs.hpp"

namespace cairn::performance {

/// The claims of the thesis about a part ("cave", "freiburg", "action") and whether the runs show
/// them: a claim is seen if all of its inequalities hold between means; "clear" if every paired
/// difference has an interval clear of zero as well.
std::string claims_table(std::string_view part, const std::vector<ExploreMethod>& methods);

}  // namespace cairn::performance
