// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "study_report.hpp"
#include "tables.hpp"
#include "thesis_exploration.hpp"

namespace cairn::performance {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// What a method measures with a seed.
struct Figures {
  double map_entropy = 500.0, loops = 20.0, coverage = 700.0, seconds = 1.0, error = 0.1;
};

/// A run whose map has errors of so much of its coverage, as `cairn explore --json` writes it.
std::string run(int seed, const Figures& f) {
  return fmt::format(
      R"({{"explorer": "x", "seed": {0}, "end": "limit", "why": "250 m are driven",
          "measures": {{"map_entropy": {1}, "loops": {2}, "coverage": {3}, "distance": 250,
                        "trajectory_entropy": -6, "map_error": {4}, "collisions": 0}},
          "measured_seconds": {{"seconds": {5}, "decision_p95": 0.5}},
          "samples": {{"distance": [0, 250], "coverage": [0, {3}], "map_error": [0, {4}],
                       "seen": [0, {3}], "free_wrong": [0, {4}], "occupied_wrong": [0, 0]}}}})",
      seed, f.map_entropy, f.loops, f.coverage, f.error * f.coverage, f.seconds);
}

std::string entry(const std::string& part, const std::string& method,
                  const std::vector<Figures>& seeds) {
  std::string runs;
  for (std::size_t k = 0; k < seeds.size(); ++k)
    runs += (k > 0 ? ", " : "") + run(static_cast<int>(k) + 1, seeds[k]);
  return fmt::format(R"({{"part": "{}", "name": "fr079", "method": "{}", "explorer": "{}",
      "report": {{"world": "lidar_building:fov=180", "policy": "p", "registration": "icp",
                  "mapper": "log_odds", "runs": [{}]}}}})",
                     part, method, method, runs);
}

TEST(ThesisExploration, HasTheFiguresOfTables54To56) {
  EXPECT_EQ(thesis_exploration("cave", "ede_gradient").loops, 22.0);
  EXPECT_EQ(thesis_exploration("freiburg", "ede_rrt_star").seconds, 11951.18);
  const ThesisExploration heuristic = thesis_exploration("action", "heuristic");
  EXPECT_EQ(thesis_value(heuristic, "coverage"), 514.10);
  EXPECT_EQ(thesis_value(heuristic, "trajectory_entropy"), -10.11);
  EXPECT_TRUE(std::isnan(thesis_value(heuristic, "ate")));
  EXPECT_TRUE(std::isnan(thesis_exploration("action", "dopt").loops));
  // 988.6 − 0.615 · coverage, to 5.1 nats·m²: the table is consistent, and read right.
  for (const char* method : {"frontier", "heuristic", "ede_rrt_star", "drrt_star", "errt_star"}) {
    const ThesisExploration row = thesis_exploration("action", method);
    EXPECT_NEAR(row.map_entropy, 988.6 - 0.615 * row.coverage, 5.1) << method;
  }
}

TEST(ExploreTables, PutMeansBesideTheThesiss) {
  const std::string table = section(
      report("explore_action",
             entry("action", "frontier", {{.loops = 20.0}, {.loops = 24.0}}) + "," +
                 entry("action", "ours: dopt", {{.loops = 30.0}, {.loops = 30.0}}) + "," +
                 R"({"part": "action", "name": "fr079", "method": "errt_star", "missing": true})"),
      "explore-action");
  EXPECT_THAT(table, HasSubstr("| loop closures | 22 ± 25 (22.6) | 30.00 ± 0.00 | - (34.4) |"));
  EXPECT_THAT(table, HasSubstr("| ends | 2 limit | 2 limit | not in this build |"));
  EXPECT_THAT(table, HasSubstr("| the thesis's time per metre over ours | 1089 × | - | - |"));
  EXPECT_THAT(table, HasSubstr("On `fr079`; world `lidar_building:fov=180`"));
}

TEST(ExploreTables, DifferencesArePairedBySeed) {
  // Seeds differ by much, the methods by 10 and 12.
  const boost::json::value both = report(
      "explore_scale",
      entry("scale", "frontier", {{.map_entropy = 500.0}, {.map_entropy = 700.0}}) + "," +
          entry("scale", "drrt_star",
                {{.map_entropy = 490.0, .error = 0.05}, {.map_entropy = 688.0, .error = 0.05}}));
  const std::string table = section(both, "explore-scale-differences");
  EXPECT_THAT(table, HasSubstr("| map entropy [nats·m²] | -11 ± 13 |"));
  // 0.1 and 0.05 of 700 m²: the same in both seeds.
  EXPECT_THAT(table, HasSubstr("| map error at equal coverage [m²] | -35.00 ± 0.00 * |"));
  EXPECT_THAT(table, HasSubstr("| wrong cells, as much floor seen [m²] | -35.00 ± 0.00 * |"));
}

TEST(ExploreTables, ClaimsAreSeenNotSeenOrNotMeasured) {
  const std::string table = section(
      report("explore_cave",
             entry("cave", "frontier",
                   {{.map_entropy = 50.0, .seconds = 3.0}, {.map_entropy = 52.0, .seconds = 4.0}}) +
                 "," +
                 entry("cave", "ede_gradient",
                       {{.map_entropy = 51.0, .loops = 50.0, .seconds = 1.0},
                        {.map_entropy = 51.0, .loops = 50.0, .seconds = 2.0}}) +
                 "," +
                 entry("cave", "ede_rrt_star",
                       {{.map_entropy = 51.0, .seconds = 1.1},
                        {.map_entropy = 51.0, .seconds = 2.1}})),
      "explore-cave-claims");
  EXPECT_THAT(table, HasSubstr("similar map entropy (within 10 %) | seen"));
  EXPECT_THAT(table, HasSubstr("close a similar number of loops (within 50 %) | not seen | loops: "
                               "ede_gradient − 1.50 · frontier = +20.00 ± 0.00"));
  EXPECT_THAT(table, HasSubstr("| both EDE take less time | seen, clear of zero |"));
  const std::string alone =
      section(report("explore_cave", entry("cave", "frontier", {{}})), "explore-cave-claims");
  EXPECT_THAT(alone, HasSubstr("| both EDE take less time | not measured |"));
  EXPECT_THAT(alone, Not(HasSubstr("| seen |")));
}

TEST(ExploreTables, FloorsSayHowEachRunEnded) {
  const boost::json::value floors =
      report("explore_floors", entry("floors", "frontier", {{}, {.coverage = 300.0}}) + "," +
                                   entry("exact", "frontier", {{}}) + "," +
                                   R"({"part": "floors", "name": "depot", "method": "dopt",
                                "error": "took too long"})");
  const std::string table = section(floors, "explore-floors");
  EXPECT_THAT(table, HasSubstr("| fr079 | frontier | 1 | limit | 250 m are driven | 250 |"));
  EXPECT_THAT(table, HasSubstr("|  | frontier | 2 | limit |"));
  EXPECT_THAT(table, HasSubstr("| depot | dopt |  | took too long |"));
  EXPECT_THAT(section(floors, "explore-exact"), HasSubstr("| fr079 | limit | 250 m are driven |"));
}

}  // namespace
}  // namespace cairn::performance
