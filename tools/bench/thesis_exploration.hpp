// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "thesis_figures.hpp"

namespace cairn::performance {

// What Tables 5.4 to 5.6 of Vallvé (2018) say. What they do not say is NaN (`kNotSaid`).

/// Means over the runs of one method.
struct ThesisExploration {
  double map_entropy = kNotSaid;         ///< [nats·m²]; the thesis has nats
  double trajectory_entropy = kNotSaid;  ///< [nats]
  double seconds = kNotSaid;             ///< of a run, without rendering the map
  double loops = kNotSaid;
  double coverage = kNotSaid;   ///< [m²]
  double map_error = kNotSaid;  ///< [m²]
};

/// `part` is "cave" (Table 5.4), "freiburg" (5.5) or "action" (5.6); `method` is "frontier",
/// "heuristic", "ede_gradient", "ede_rrt_star", "drrt_star" or "errt_star".
ThesisExploration thesis_exploration(std::string_view part, std::string_view method);

/// By the name of a measure in the reports of `cairn explore`.
double thesis_value(const ThesisExploration& thesis, std::string_view measure);

}  // namespace cairn::performance
