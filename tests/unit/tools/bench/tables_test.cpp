// SPDX-License-Identifier: BSD-3-Clause
#include "tables.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "json_access.hpp"
#include "study_report.hpp"

namespace cairn::performance {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string times_ten(const std::string& text) {
  std::string all = text;
  for (int k = 1; k < 10; ++k) all += "," + text;
  return all;
}

/// Two rounds of ten iterations; Ceres ended after two, of which it took one.
std::string configuration(const std::string& optimizer, const std::string& linear_solver,
                          double seconds_per_iteration, double chi2) {
  const std::string run = R"({"iterations": 10, "seconds": {"total": )" +
                          std::to_string(10 * seconds_per_iteration) + "}}";
  const std::string history = optimizer.starts_with("ceres")
                                  ? R"({"accepted": true}, {"accepted": false})"
                                  : times_ten(R"({"accepted": true})");
  return R"({"optimizer": ")" + optimizer + R"(", "linear_solver": ")" + linear_solver +
         R"(", "seconds": {"median": 1, "min": 1, "max": 1, "per_iteration": )" +
         std::to_string(seconds_per_iteration) + R"(}, "chi2": {"final": )" + std::to_string(chi2) +
         R"(}, "peak_memory_bytes": 25000000, "runs": [)" + run + "," + run + R"(], "history": [)" +
         history + "]}";
}

/// Two published graphs and a generated one; the second CHOLMOD is the faster.
boost::json::value graphs_report() {
  const auto entry = [](const std::string& name, const std::string& generated, double ours,
                        double theirs) {
    return R"({"name": ")" + name + R"(", "generated": )" + generated +
           R"(, "threads": 1, "measured": {"graph": {"variables": 100, "factors": 200},
                 "configurations": [)" +
           configuration("gauss_newton", "block_cholesky", ours, 146.5) + "," +
           configuration("gauss_newton", "cholmod:mode=simplicial,ordering=amd", 2 * theirs,
                         146.5) +
           "," +
           configuration("gauss_newton", "cholmod:mode=supernodal,ordering=metis", theirs, 146.5) +
           "," +
           configuration("ceres:sparse_library=cx_sparse,initial_radius=1e16", "X", 4 * ours,
                         293.0) +
           "]}}";
  };
  return report("graphs", entry("first", "false", 0.002, 0.004) + "," +
                              entry("second", "false", 0.002, 0.016) + "," +
                              entry("made", "true", 0.002, 0.010));
}

TEST(PerformanceTables, TakeTheBestSettingOfEachPeer) {
  const std::string table = section(graphs_report(), "graphs-1");
  EXPECT_THAT(table, HasSubstr("| first | 100 | 200 | 2.00 | 4.00 (supernodal, metis) | 2.00 × "
                               "| 8.00 (cx_sparse; 1 of 2 steps taken) | 4.00 × | 0 | 1e+00 | 25 "
                               "/ 25 / 25 |\n"));
  EXPECT_THAT(table, Not(HasSubstr("simplicial")));
}

TEST(PerformanceTables, AverageRatiosOfPublishedAndGeneratedGraphsApart) {
  const std::string table = section(graphs_report(), "graphs-1");
  EXPECT_THAT(table, HasSubstr("**published, geometric mean** |  |  |  |  | **4.00 ×**"));
  EXPECT_THAT(table, HasSubstr("**generated, geometric mean** |  |  |  |  | **5.00 ×**"));
}

TEST(PerformanceTables, ShowThreadCountsInTablesOfTheirOwn) {
  EXPECT_THAT(section(graphs_report(), "graphs-2"), Not(HasSubstr("first")));
}

TEST(PerformanceTables, NameMachineBuildAndCommit) {
  EXPECT_THAT(section(graphs_report(), "graphs-1"),
              HasSubstr("*Some CPU, 2 cores, avx2; gcc, `-O3`; commit abc1234.*"));
}

TEST(PerformanceTables, DrawOnlyTheBestOfEachFamily) {
  const boost::json::value report = graphs_report();
  const boost::json::value picture = graphs_picture(list(report, "entries"));
  EXPECT_EQ(list(picture, "graphs").size(), 3U);
  EXPECT_EQ(list(list(picture, "graphs").front(), "configurations").size(), 3U);
}

TEST(PerformanceTables, GiveRatesAgainstTheNearerRoof) {
  // 2 GFLOP in 0.1 s; 2e9 / (16 * 1.25e8) = 1 flop per byte at 25 GB/s lies below dgemm's 50.
  const auto rates = report("rates", R"({"name": "big", "factorize": 0.1, "dgemm": 5e10,
      "bandwidth": 2.5e10, "solver": {"ordering": "amd", "factor_flops": 2e9,
      "factor_nonzeros": 125000000}})");
  EXPECT_THAT(section(rates, "rates"),
              HasSubstr("| big | amd | 125 M | 2 G | 100 | 20.0 | 40 % | 1.00 | 25.0 | 80 % |\n"));
}

TEST(PerformanceTables, SayWhereThereIsNoDgemmToCompareWith) {
  const auto rates = report("rates", R"({"name": "big", "factorize": 0.1, "dgemm": null,
      "bandwidth": 2.5e10, "solver": {"factor_flops": 2e9, "factor_nonzeros": 125000000}})");
  EXPECT_THAT(section(rates, "rates"), HasSubstr("No OpenBLAS"));
}

TEST(PerformanceTables, CompareOneThreadWithTwo) {
  const auto threads = report("threads", R"({"name": "torus",
      "one": {"iteration": 0.04, "factorize": 0.03}, "two": {"iteration": 0.025, "factorize": 0.015}})");
  EXPECT_THAT(section(threads, "threads"),
              HasSubstr("| torus | 30.0 | 15.0 | 2.00 × | 40.0 | 25.0 | 1.60 × |\n"));
}

/// Three sizes of quadratic growth, the smallest outside the fit, and one left out.
boost::json::value scaling_report() {
  const auto entry = [](const std::string& poses, const std::string& seconds) {
    return R"({"family": "city", "study": "ten iterations", "poses": )" + poses +
           R"(, "graph": {"variables": )" + poses +
           R"(, "factors": 7}, "iterations": 5, "solver": {}, "seconds": )" + seconds +
           R"(, "peak_memory_bytes": )" + poses + "000},";
  };
  return report("scaling", entry("1000", "77") + entry("10000", "1") + entry("100000", "100") +
                               R"({"family": "city", "poses": 1000000, "left_out": "too long"})");
}

TEST(PerformanceTables, FitTheGrowthFromTenThousandPosesOn) {
  EXPECT_THAT(section(scaling_report(), "growth"),
              HasSubstr("| city | 10000 … 100000 | 2 | n^2.00 | n^1.00 |\n"));
}

TEST(PerformanceTables, ListTheSizesThatWereLeftOut) {
  EXPECT_THAT(section(scaling_report(), "scaling"), HasSubstr("left out: too long"));
}

TEST(PerformanceTables, PointOutAnotherChi2) {
  const auto entry = [](const std::string& setting, const std::string& chi2) {
    return R"({"name": "park", "setting": ")" + setting +
           R"(", "result": "converged", "finished": true,
        "graph": {"variables": 9, "factors": 8}, "iterations": 3, "seconds": 0.01,
        "chi2": {"initial": 1e4, "final": )" +
           chi2 + "}}";
  };
  const auto solvers = report("solvers", entry("ours", "100.0") + "," + entry("same", "100.0") +
                                             "," + entry("worse", "200.0") + "," +
                                             R"({"name": "park", "setting": "stuck",
                                                 "result": "not finished after 60 s"})");
  const std::string text = section(solvers, "solvers");
  EXPECT_THAT(text, HasSubstr("**park** (9 variables, 8 factors)\n"));
  EXPECT_THAT(text, HasSubstr("| `same` | 100 | 0 | 3 |  | 10.0 | 1.00 × | - | converged |\n"));
  EXPECT_THAT(text,
              HasSubstr("| 1e+00 | 3 |  | 10.0 | 1.00 × | - | converged, **another chi2** |"));
  EXPECT_THAT(text, HasSubstr("| `stuck` | - | - | - |  | - | - | - | not finished after 60 s |"));
}

TEST(PerformanceTables, DoNotTakeRoundingForAnotherChi2) {
  const auto entry = [](const std::string& chi2) {
    return R"({"name": "exact", "setting": "x", "result": "converged", "finished": true,
        "graph": {"variables": 9, "factors": 8}, "chi2": {"initial": 1e4, "final": )" +
           chi2 + "}}";
  };
  const std::string text =
      section(report("solvers", entry("4e-25") + "," + entry("2e-25")), "solvers");
  EXPECT_THAT(text, HasSubstr("| 2e-25 | 2e-17 |"));
  EXPECT_THAT(text, Not(HasSubstr("another chi2")));
}

TEST(PerformanceTables, RefuseAStudyThatTheyDoNotKnow) {
  EXPECT_THROW(sections(report("astrology", "")), std::runtime_error);
}

TEST(PerformanceTables, CompareCovariancesWithSolvesWhereThoseWereMeasured) {
  const std::string table = section(
      report("marginals",
             R"({"name": "small", "graph": {"variables": 100}, "solver": {"factor_nonzeros": 5000},
                 "factorize": 0.001, "both": 0.002, "diagonal": 0.0015, "column": 0.0005,
                 "two_threads": 0.0016, "solves": 0.05},
                {"name": "large", "graph": {"variables": 90000}, "solver": {}, "factorize": 0.1,
                 "both": 0.2, "diagonal": 0.15, "column": 0.05, "two_threads": 0.16,
                 "solves": null})"),
      "marginals");
  EXPECT_THAT(table, HasSubstr("| small | 100 | 5 k | 1.00 | 1.50 | 0.500 | 2.00 | 1.60 | 50.0 | "
                               "25.0 × |"));
  EXPECT_THAT(table, HasSubstr("| large | 90000 | - | 100 | 150 | 50.0 | 200 | 160 | - | - |"));
}

/// A run of 200 steps.
std::string replay(const std::string& name, double seconds, double chi2,
                   const std::string& more = "") {
  return R"({"name": ")" + name + R"(", "in_time": true, "limit": 60, "runs": [{"seconds":
      {"total": )" +
         std::to_string(seconds) +
         R"(, "marginals": 0.5}, "steps": {"count": 200, "median": 0.001, "p95": 0.002,
      "p99": 0.003, "max": 0.004}, "peak_memory_bytes": 3e7, "chi2": )" +
         std::to_string(chi2) + more + "}]}";
}

std::string online_entry(const std::string& part, const std::string& contestants,
                         const std::string& more = "") {
  return R"({"part": ")" + part + R"(", "name": "town", "contestants": [)" + contestants + "]" +
         more + "}";
}

/// chi2 is rounding at the first sample, 2 % above batch at the second; the last is finished.
boost::json::value online_report() {
  const std::string checks = R"(, "checks": [
      {"step": 1, "chi2": 3e-20, "batch": 1e-20, "polished": 1e-20},
      {"step": 100, "chi2": 51.0, "batch": 50.0, "polished": 50.5},
      {"step": 200, "chi2": 100.0, "batch": 400.0, "polished": 100.0}])";
  const std::string late = R"({"name": "batch", "in_time": false, "limit": 60, "runs": []})";
  return report("online",
                online_entry("times",
                             replay("incremental_cholesky", 2.0, 100.5) + "," +
                                 replay("periodic_batch", 8.0, 103.0) + "," + late,
                             checks) +
                    "," +
                    online_entry("marginals", replay("incremental_cholesky", 2.5, 100.5,
                                                     R"(, "marginals_by": {"downdate": 150,
                                                        "recomputation": 50})")));
}

TEST(PerformanceTables, CompareReplaysAndSayWhichOneWasNotFinished) {
  EXPECT_THAT(section(online_report(), "online-times"),
              HasSubstr("| town | 200 | 2.00 | 1.00 | 2.00 | 3.00 | 4.00 | 8.00 | 4.00 × | 4.00 | "
                        "> 60 | - | 30 / 30 |\n"));
}

TEST(PerformanceTables, TakeTheLowerOfTwoBatchesAndLeaveSamplesOfRoundingOut) {
  EXPECT_THAT(section(online_report(), "online-chi2"),
              HasSubstr("| town | 100.5 | 400 | 100 | 0.500 % | 2.000 % | 0.000 % | 3.000 % |\n"));
}

TEST(PerformanceTables, TellTheShareOfCovariancesAndHowTheyWereBroughtUpToDate) {
  EXPECT_THAT(
      section(online_report(), "online-marginals"),
      HasSubstr("| town | 200 | 2.50 | 2.00 | 20 % | 1.00 | 2.00 | 3.00 | 4.00 | 150 | 50 | "
                "0 | 30 |\n"));
}

TEST(PerformanceTables, CompareALimitOfTimeWithNone) {
  const std::string check =
      R"(, "checks": [{"step": 200, "chi2": 100.5, "batch": 100.0, "polished": 100.0}])";
  const auto limited =
      report("online", online_entry("budget",
                                    replay("none", 2.0, 100.5, R"(, "owed": 0)" + check) + "," +
                                        replay("budget", 1.0, 101.0, R"(, "owed": 17)" + check),
                                    R"(, "budget": 0.005)"));
  const std::string table = section(limited, "online-budget");
  EXPECT_THAT(table, HasSubstr("| town | none | 2.00 | 1.00 | 2.00 | 3.00 | 4.00 | 100.5 | 0.500 % "
                               "| 0 |\n"));
  EXPECT_THAT(table, HasSubstr("| town | 5.00 | 1.00 | 1.00 | 2.00 | 3.00 | 4.00 | 101 | 1.000 % | "
                               "17 |\n"));
}

TEST(PerformanceTables, DrawAPointForSoManySteps) {
  const auto steps = report("online", R"({"part": "steps", "name": "town", "setting": "ours",
      "every": 3, "longest": [0.1, 0.2]}, {"part": "steps", "name": "town", "setting": "theirs",
      "every": 3, "longest": [0.3, 0.4]})");
  const boost::json::value picture = online_picture(list(steps, "entries"));
  ASSERT_EQ(list(picture, "graphs").size(), 1U);
  const boost::json::array& curves = list(list(picture, "graphs").front(), "configurations");
  ASSERT_EQ(curves.size(), 2U);
  const boost::json::array& history = list(curves.front(), "history");
  ASSERT_EQ(history.size(), 6U);
  EXPECT_TRUE(std::isnan(number(history[4], "seconds")));
  EXPECT_EQ(number(history[5], "seconds"), 0.2);
}

}  // namespace
}  // namespace cairn::performance
