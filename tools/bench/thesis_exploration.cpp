// SPDX-License-Identifier: BSD-3-Clause
#include "thesis_exploration.hpp"

namespace cairn::performance {
namespace {

struct Row {
  std::string_view part, method;
  ThesisExploration said;
};

constexpr Row kRows[] = {{"cave", "frontier", {.seconds = 2814.14, .loops = 15.4}},
                         {"cave", "ede_gradient", {.seconds = 601.02, .loops = 22.0}},
                         {"cave", "ede_rrt_star", {.seconds = 487.15, .loops = 17.0}},
                         {"freiburg", "frontier", {.seconds = 2505.44, .loops = 12.5}},
                         {"freiburg", "ede_gradient", {.seconds = 2586.84, .loops = 3.0}},
                         {"freiburg", "ede_rrt_star", {.seconds = 11951.18, .loops = 12.5}},
                         {"action", "frontier", {527.92, -5.06, 1089.15, 22.6, 741.32, 130.80}},
                         {"action", "heuristic", {670.93, -10.11, 78997.9, 43.2, 514.10, 87.84}},
                         {"action", "ede_rrt_star", {584.23, -6.55, 1083.70, 25.4, 660.86, 106.34}},
                         {"action", "drrt_star", {526.58, -6.34, 8752.13, 18.8, 749.96, 126.56}},
                         {"action", "errt_star", {558.80, -5.57, 59785.42, 34.4, 707.10, 112.22}}};

}  // namespace

ThesisExploration thesis_exploration(std::string_view part, std::string_view method) {
  for (const Row& row : kRows) {
    if (row.part == part && row.method == method) return row.said;
  }
  return {};
}

double thesis_value(const ThesisExploration& thesis, std::string_view measure) {
  if (measure == "map_entropy") return thesis.map_entropy;
  if (measure == "trajectory_entropy") return thesis.trajectory_entropy;
  if (measure == "seconds") return thesis.seconds;
  if (measure == "loops") return thesis.loops;
  if (measure == "coverage") return thesis.coverage;
  if (measure == "map_error") return thesis.map_error;
  return kNotSaid;
}

}  // namespace cairn::performance
