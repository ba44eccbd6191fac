// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <boost/json/array.hpp>
#include <boost/json/value.hpp>

#include "cairn/evaluation/mean_interval.hpp"
#include "cairn/exploration/explorer_comparison.hpp"

namespace cairn::performance {

/// One method of a study of `cairn explore`, as its entry has it.
struct ExploreMethod {
  std::string name;
  std::string problem;  ///< why it has no runs: "not in this build", …; or empty
  std::vector<ComparedRun> runs;
};

/// The methods of the entries, in their order.
std::vector<ExploreMethod> explore_methods(const boost::json::array& entries);

/// What two methods are compared by: a measure by its name, or "map_error at equal coverage", or
/// "wrong at equal part seen" (`difference_at_equal_coverage`).
inline constexpr std::string_view kMapErrorAtCoverage = "map_error at equal coverage";
inline constexpr std::string_view kWrongAtSeen = "wrong at equal part seen";

/// The mean of a measure over the runs of a method.
MeanInterval mean_of(const ExploreMethod& method, std::string_view measure);
/// Of `method − factor · reference`, seed by seed.
MeanInterval difference_of(const ExploreMethod& method, const ExploreMethod& reference,
                           std::string_view measure, double factor = 1.0);
/// "4 limit, 1 stuck"
std::string ends_of(const ExploreMethod& method);

}  // namespace cairn::performance
