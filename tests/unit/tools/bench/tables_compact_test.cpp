// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include <fmt/format.h>

#include "json_access.hpp"
#include "study_report.hpp"
#include "tables.hpp"

namespace cairn::performance {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// A run that kept a part of 100 poses and 200 loops; all errors follow from one.
std::string run(double seconds, int poses, int loops, double error,
                const std::string& more = "\"verdicts\": {}") {
  const std::string errors = fmt::format(
      R"({{"ate": {{"translation": {0}, "rotation": {1}}},
          "rpe": {{"translation": {0}, "rotation": {1}}},
          "rpe_all": {{"translation": {0}, "rotation": {1}}}}})",
      error, 2.0 * error);
  return fmt::format(
      R"({{"poses": {{"in": 100, "kept": {}}}, "loops": {{"in": 200, "kept": {}, "registered": 90,
           "false_registered": 9, "false_kept": 3}}, "seconds": {{"total": {}}},
          "steps": {{"p99": 0.001}}, "nonzeros": {{"information": 5000, "factor": 7000}},
          "errors": {{"v2": {}, "likely": {}}}, "peak_memory_bytes": 2e7, {}}})",
      poses, loops, seconds, errors, errors, more);
}

std::string contestant(const std::string& name, const std::string& runs) {
  return fmt::format(R"({{"name": "{}", "in_time": {}, "limit": 300, "runs": [{}]}})", name,
                     !runs.empty(), runs);
}

std::string control(const std::string& name, int converged, const std::string& runs) {
  return fmt::format(
      R"({{"name": "{}", "in_time": true, "limit": 300, "converged": {}, "runs": [{}]}})", name,
      converged, runs);
}

std::string thresholds(double loop_gain) {
  return fmt::format(
      R"({{"options": {{"range": "2.5", "angle": "0.25", "probability": "0.1", "pose_gain": "5.75",
          "loop_gain": "{}"}}, "trials": [{{}}, {{}}], "seconds": 0.5}})",
      loop_gain);
}

boost::json::value sets_report(const std::string& name, const std::string& apal,
                               bool de_facto = false) {
  return report(
      "compact_sets",
      fmt::format(
          R"({{"name": "{}", "de_facto": {}, "refined": {}, "plain": {}, "by_rule": {}, "contestants": [{}]}})",
          name, de_facto, thresholds(3.5), thresholds(5.0), thresholds(7.0),
          contestant("apal", run(20.0, 100, 200, 0.2)) + "," + contestant("tested", apal) + "," +
              contestant("fpfl", run(0.5, 20, 10, 0.3) + "," + run(1.0, 20, 10, 0.3)) + "," +
              contestant("plain", run(0.5, 15, 10, 0.35)) + "," +
              contestant("by_rule", run(0.25, 10, 5, 0.4)) + "," +
              control("random", 3,
                      run(1.0, 20, 10, 0.6) + "," + run(1.0, 20, 10, 1.2) + "," +
                          run(1.0, 20, 10, 9.0)) +
              "," + control("random_poses", 1, run(1.0, 20, 8, 0.9) + "," + run(1.0, 20, 8, 0.9))));
}

const std::string kApal = run(4.0, 100, 200, 0.2) + "," + run(12.0, 100, 200, 0.2);

TEST(CompactTables, PutThresholdsBesideThePapers) {
  const std::string table = section(sets_report("parking-garage", kApal), "compact-thresholds");
  EXPECT_THAT(table,
              HasSubstr("| parking-garage | the paper's | 95.0 | 1.10 | 0.100 | 5.77 | 2.45 "
                        "|  |  |\n|  | by the rule | 2.50 | 0.250 | 0.100 | 5.75 | 7.00 | 2 "
                        "| 0.500 |\n|  | without relocation | 2.50 | 0.250 | 0.100 | 5.75 | 5.00 | "
                        "2 | 0.500 |\n|  | refined | 2.50 | 0.250 | 0.100 | 5.75 | 3.50 |"));
}

TEST(CompactTables, PairTimesWithinARound) {
  const std::string table = section(sets_report("parking-garage", kApal), "compact-times");
  EXPECT_THAT(table, HasSubstr("| parking-garage | 100 | 200 | refined | 8.00 | 0.750 | 10.0 × | "
                               "5.0 % | 20.0 % | 1.00 | 1.00 |\n"));
  EXPECT_THAT(table, HasSubstr("|  |  |  | the paper's | 103 | 30.6 | 3.37 × | 20.9 % | 64.3 % |"));
}

TEST(CompactTables, SayThatAllPosesAndLoopsTookTooLong) {
  EXPECT_THAT(section(sets_report("town", ""), "compact-times"),
              HasSubstr("| town | 100 | 200 | refined | > 300 | 0.750 | > 400 × |"));
}

TEST(CompactTables, GiveErrorsOverThoseOfEverythingAndOfTheSameSizeAtRandom) {
  const std::string table = section(sets_report("parking-garage", kApal, true), "compact-errors");
  EXPECT_THAT(table, HasSubstr("| parking-garage † | APAL | 0.200 | 0.400 |"));
  EXPECT_THAT(table, HasSubstr("|  | APAL, distance test | 0.200 | 0.400 | 0.200 | 0.400 | 0.200 | "
                               "0.400 | 1.00 × |  |\n"));
  EXPECT_THAT(table, HasSubstr("|  | FPFL | 0.300 | 0.600 | 0.300 | 0.600 | 0.300 | 0.600 | 1.50 × "
                               "|  |\n"));
  EXPECT_THAT(table, HasSubstr("|  | RFPFL, loops first | 1.20 | 2.40 | 1.20 | 2.40 | 1.20 | 2.40 "
                               "| 6.00 × | 4.00 × |\n"));
  EXPECT_THAT(table, HasSubstr("|  | RFPFL, poses first | 0.900 | 1.80 | 0.900 | 1.80 | 0.900 | "
                               "1.80 | 4.50 × | 3.00 × |\n"));
}

TEST(CompactTables, PutThePapersErrorsBesideWithAllToAllAsItShouldBe) {
  const std::string table = section(sets_report("parking-garage", kApal, true), "compact-errors");
  EXPECT_THAT(table,
              HasSubstr("|  | the paper's APAL | 0.193 | 0.787 | 0.0160 | 0.270 | 3.62 | 1.10 "
                        "|  |  |\n"));
  EXPECT_THAT(table, HasSubstr("|  | the paper's FPFL | 0.661 | 0.757 | 0.0120 | 0.109 | 1.65 | "
                               "0.915 | 3.42 × |  |\n"));
  EXPECT_THAT(table, HasSubstr("|  | the paper's RFPFL | 6.20 | 9.76 | 0.247 | 1.69 | 14.0 | 10.3 "
                               "| 32.1 × | 9.38 × |\n"));
}

TEST(CompactTables, SayHowManyOfTheControlsHaveConverged) {
  const std::string table = section(sets_report("town", kApal), "compact-control");
  EXPECT_THAT(table,
              HasSubstr("| town | loops | 20 | 10 | 10 | 3 of 3 | 2.00 × | 4.00 × | 30.0 × |\n"));
  EXPECT_THAT(table, HasSubstr("|  | poses | 20 | 8 | 10 | 1 of 2 | 3.00 × | 3.00 × | 3.00 × |\n"));
}

TEST(CompactTables, CompareWaysOfRecoveryWithThePapersTable) {
  const std::string table = section(sets_report("kitti_00", kApal), "compact-recovery");
  EXPECT_THAT(table, HasSubstr("| kitti_00 | v0 | - |"));
  EXPECT_THAT(table, HasSubstr("|  | v2 | 0.400 | 0.800 | 0.400 | 0.800 | 0.400 | 0.800 | 0.300 | "
                               "0.600 |\n"));
  EXPECT_THAT(table,
              HasSubstr("|  | the paper's v2 | 3.09 | 2.25 | 0.0290 | 0.119 | 10.3 | 3.14 |"));
  EXPECT_THAT(section(sets_report("town", kApal), "compact-recovery"), Not(HasSubstr("paper's")));
}

TEST(CompactTables, LeaveOutThePapersRowsForOtherGraphs) {
  const boost::json::value report = sets_report("town", kApal);
  EXPECT_THAT(section(report, "compact-errors"), HasSubstr("| 6.00 × | 4.00 × |\n"));
  EXPECT_THAT(section(report, "compact-errors"), Not(HasSubstr("paper's")));
  EXPECT_THAT(section(report, "compact-times"), Not(HasSubstr("paper's")));
}

TEST(CompactTables, ShowLoopsAndErrorsAgainstTheThresholdOnTheirGain) {
  const auto gains =
      report("compact_gain",
             fmt::format(R"({{"name": "town", "apal": {}, "runs": [{{"factor": 0, "loop_gain": 0,
                      "run": {}}}, {{"factor": 0.707, "loop_gain": 3.5, "run": {}}}]}})",
                         run(9.0, 100, 200, 0.2), run(8.0, 100, 180, 0.2), run(1.0, 100, 20, 0.5)));
  const std::string table = section(gains, "compact-gain");
  EXPECT_THAT(table, HasSubstr("| town | 0 | 0.00 | 180 | 90.0 % | 0.200 | 0.400 | 1.00 × |\n"));
  EXPECT_THAT(table, HasSubstr("|  | 0.707 | 3.50 | 20 | 10.0 % | 0.500 | 1.00 | 2.50 × |\n"));
}

TEST(CompactTables, TheCurvesOfSensitivityAreThoseOfTheTable) {
  const auto gains = report(
      "compact_gain",
      fmt::format(R"({{"name": "town", "apal": {}, "runs": [{{"factor": 0, "loop_gain": 0,
                      "run": {}}}, {{"factor": 0.707, "loop_gain": 3.5, "run": {}}}]}})",
                  run(9.0, 100, 200, 0.25), run(8.0, 100, 180, 0.25), run(1.0, 100, 20, 0.5)));
  EXPECT_EQ(gain_curves(list(gains, "entries")),
            "threshold over the rule's,\"loop closures kept [%], town\",\"ATE over that of APAL, "
            "town\"\n0,90,1\n0.707,10,2\n");
}

TEST(CompactTables, StandBesideTheFigures) {
  const auto figures =
      report("compact_figures",
             fmt::format(R"({{"name": "town", "apal": {}, "apfl": {}, "fpfl": {}}})",
                         run(9.0, 100, 200, 0.25), run(8.0, 100, 20, 0.5), run(1.0, 30, 10, 0.75)));
  const std::string table = section(figures, "compact-figures");
  EXPECT_THAT(table, HasSubstr("| town | (a) all poses, all loop closures | 100 | 100.0 % | 200 | "
                               "100.0 % | 0.250 | 0.500 |\n"));
  EXPECT_THAT(table,
              HasSubstr("|  | (c) few of both | 30 | 30.0 % | 10 | 5.0 % | 0.750 | 1.50 |\n"));
}

TEST(CompactTables, ShowWhatARobotHasLive) {
  const std::string asked = R"("verdicts": {}, "peak": 0)";
  std::string kept = run(1.0, 25, 20, 0.5, asked);
  kept.replace(kept.find("\"registered\""), 0, "\"proposed\": 300, ");
  const auto live =
      report("compact_live",
             fmt::format(R"({{"name": "town", "de_facto": true, "contestants": [{}, {}, {}]}})",
                         contestant("fpfl", kept), contestant("apal", ""),
                         contestant("random", run(1.0, 25, 20, 0.7) + "," + run(1.0, 25, 20, 0.9) +
                                                  "," + run(1.0, 25, 20, 0.8))));
  EXPECT_THAT(section(live, "compact-live"),
              HasSubstr("| town † | 25 | 100 | 20 | 3.00 | 15.0 | 20 | 0.500 | 1.00 | - | - | "
                        "0.800 | 1.60 | - | - |\n"));
}

/// Quadratic for all, linear for few; all were late at the last.
boost::json::value growth_report() {
  std::string entries = R"({"part": "thresholds"})";
  for (const int laps : {1, 5, 10, 20}) {
    const double n = laps;
    entries += fmt::format(R"(, {{"part": "growth", "laps": {}, "contestants": [{}, {}]}})", laps,
                           contestant("tested", laps == 20 ? "" : run(n * n, 100, 200, 0.1)),
                           contestant("fpfl", run(n, 30, 10, 0.1)));
  }
  return report("compact_growth", entries);
}

TEST(CompactTables, FitTheGrowthFromFiveLapsOn) {
  const std::string text = section(growth_report(), "compact-growth");
  EXPECT_THAT(text, HasSubstr("| 10 | 100 | 200 | 100 | 10.0 | 30 | 10 | - | - | - |\n"));
  EXPECT_THAT(text, HasSubstr("| 20 | 100 | 200 | > 300 | 20.0 |"));
  EXPECT_THAT(text, HasSubstr("| 10 | 5 k | 7 k | 5 k | 7 k | - | - |\n"));
  EXPECT_THAT(text,
              HasSubstr("APAL: time as N^2.00, nonzeros of L as N^0.00; FPFL: time as N^1.00"));
}

TEST(CompactTables, DrawALineForEachStrategyThatWasInTime) {
  const boost::json::value report = growth_report();
  const boost::json::value picture = compact_picture(list(report, "entries"));
  EXPECT_EQ(list(picture, "graphs").size(), 7U);  // three of APAL, four of FPFL
  EXPECT_EQ(number(list(picture, "graphs").front(), "graph.variables"), 100.0);
}

TEST(CompactTables, ShowHowManyAreKeptAfterManyLapsAndWhetherStepsGrow) {
  const auto laps = report("compact_growth", R"({"part": "laps", "name": "by_rule", "laps": 200,
      "in_time": true, "limit": 120, "after": [{"laps": 10, "poses": 30, "loops": 40},
      {"laps": 200, "poses": 33, "loops": 99}], "first_quarter": {"median": 0.001, "p99": 0.002},
      "last_quarter": {"median": 0.003, "p99": 0.004}, "run": {"seconds": {"total": 9}}},
      {"part": "laps", "name": "fpfl", "laps": 200, "in_time": false, "limit": 120})");
  const std::string text = section(laps, "compact-laps");
  EXPECT_THAT(text, HasSubstr("| FPFL as published | 10 | 30 | 40 |\n|  | 200 | 33 | 99 |\n"));
  EXPECT_THAT(text, HasSubstr("| FPFL | 200 | not finished after 120 s | - |\n"));
  EXPECT_THAT(text, HasSubstr("| FPFL as published | 9.00 | 1.00 | 2.00 | 3.00 | 4.00 |\n"));
}

TEST(CompactTables, OfAMillionPosesHaveARowForEachStop) {
  const auto million = report("compact_million", R"({"part": "drive", "poses": 100000, "kept": 2000,
      "factors": 3600, "memory": 6.8e7, "median": 4e-5, "p99": 0.002, "longest": 0.03,
      "asked": 1.5, "left": 0.0123, "ate": 0.25, "ate_rotation": 0.01},
      {"part": "errors", "name": "live", "poses": 100000, "ate": 0.5, "ate_rotation": 0.0174533})");
  EXPECT_THAT(section(million, "compact-million"),
              HasSubstr("| 100000 | 2000 | 3600 | 68 | 0.0400 | 2.00 | 30.0 | 1.50 | 1.23 % | "
                        "0.250 |\n"));
  EXPECT_THAT(section(million, "compact-million-errors"),
              HasSubstr("| compact, each pose when it was the newest | 100000 | 0.500 | 1.00 |\n"));
}

TEST(CompactTables, CallCovariancesHonestWithinTheBandOfChi2) {
  const auto entry = [](const std::string& strategy, double squared) {
    return fmt::format(
        R"({{"part": "nees", "name": "town", "strategy": "{}", "runs": [{{"squared": {}, "dof":
            10000}}, {{"squared": 10000, "dof": 10000}}, null]}})",
        strategy, squared);
  };
  const std::string table =
      section(report("compact_consistency",
                     entry("fpfl", 8000) + "," + entry("apal", 10300) + "," + entry("apfl", 12000)),
              "compact-nees");
  EXPECT_THAT(table, HasSubstr("| town | FPFL | 2 | 20000 | 0.9000 | 0.9804 … 1.0196 | "
                               "conservative |\n"));
  EXPECT_THAT(table, HasSubstr("| 1.0150 | 0.9804 … 1.0196 | consistent |\n"));
  EXPECT_THAT(table, HasSubstr("| 1.1000 | 0.9804 … 1.0196 | overconfident |\n"));
}

TEST(CompactTables, CompareCovariancesWithThoseOfEverything) {
  const auto compared =
      report("compact_consistency", R"({"part": "compare", "name": "town", "compare":
      {"steps": 166, "marginal_conservative": 0.995, "full_conservative": 1.0,
       "least_marginal_ratio": 0.99, "least_full_ratio": 1.2, "least_eigenvalue": 0.987}},
      {"part": "compare", "name": "village", "compare": null})");
  const std::string table = section(compared, "compact-compare");
  EXPECT_THAT(table, HasSubstr("| town | 166 | 99.5 % | 0.990 | 100.0 % | 1.20 | 0.987 |\n"));
  EXPECT_THAT(table, HasSubstr("| village | - | - | - | - | - | - |\n"));
}

TEST(CompactTables, CountRefusalsAsZeroWhereThereWereNone) {
  const std::string refusing = R"("verdicts": {"inconsistent": 7, "waiting": 2})";
  const auto matches = report(
      "compact_matches",
      fmt::format(
          R"({{"name": "town", "false_rate": 0.1, "gate": 0.99, "contestants": [{}, {}, {}]}})",
          contestant("open, clean", run(1.0, 30, 40, 0.5)),
          contestant("gated, clean", run(1.0, 30, 40, 0.5, refusing)),
          contestant("open, false", "")));
  const std::string table = section(matches, "compact-matches");
  EXPECT_THAT(table, HasSubstr("| town | none | none | 90 | 9 | 40 | 3 | 0 | 0 | 30 | 0.500 | 1.00 "
                               "× |\n"));
  EXPECT_THAT(table, HasSubstr("|  | none | 0.99 | 90 | 9 | 40 | 3 | 7 | 2 | 30 |"));
  EXPECT_THAT(table, HasSubstr("|  | 10 % | none | > 300 s | - |"));
}

}  // namespace
}  // namespace cairn::performance
