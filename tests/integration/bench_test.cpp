// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

TEST(BenchCommand, ReportsTheProductOfOptimizersAndLinearSolvers) {
  const TemporaryFolder folder;
  const Outcome outcome =
      cairn({"bench", "@ring:poses=60", "@manhattan:poses=80", "--optimizer", "gauss_newton,dogleg",
             "--linear-solver", "block_cholesky:ordering=natural,eigen", "--repeat", "3", "--json",
             "-", "--csv", folder.file("runs.csv"), "--threads", "1"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto report = parse_json(outcome.out);
  EXPECT_EQ(report.at("repeat").as_int64(), 3);
  EXPECT_EQ(report.at("threads").as_int64(), 1);
  ASSERT_EQ(report.at("graphs").as_array().size(), 2u);
  for (const auto& graph : report.at("graphs").as_array()) {
    const auto& rows = graph.at("configurations").as_array();
    ASSERT_EQ(rows.size(), 4u);
    EXPECT_EQ(rows[0].at("optimizer").as_string(), "gauss_newton");
    EXPECT_EQ(rows[0].at("linear_solver").as_string(), "block_cholesky:ordering=natural");
    EXPECT_EQ(rows[3].at("optimizer").as_string(), "dogleg");
    EXPECT_EQ(rows[3].at("linear_solver").as_string(), "eigen");
    EXPECT_EQ(rows[0].at("ratio").as_double(), 1.0);
    for (const auto& row : rows) {
      EXPECT_EQ(row.at("runs").as_array().size(), 3u);
      EXPECT_TRUE(row.at("chi2").at("agrees").as_bool());
      EXPECT_LE(row.at("seconds").at("min").as_double(),
                row.at("seconds").at("median").as_double());
      EXPECT_LE(row.at("seconds").at("median").as_double(),
                row.at("seconds").at("max").as_double());
      EXPECT_GT(row.at("peak_memory_bytes").as_int64(), 1000000);
      EXPECT_GT(row.at("solver").at("factor_nonzeros").as_int64(), 0);
    }
  }
  const auto csv = lines(read_text(folder.file("runs.csv")));
  EXPECT_EQ(csv.size(), 1u + 2 * 4 * 3);
  EXPECT_THAT(csv[0], HasSubstr("seconds_total"));
}

TEST(BenchCommand, MediansAndPairedRatiosFollowFromTheRunsThatItLists) {
  const auto report = parse_json(cairn({"bench", "@ring:poses=60", "--linear-solver",
                                        "block_cholesky,eigen", "--json", "-", "--no-memory"})
                                     .out);
  const auto& rows = report.at("graphs").as_array().at(0).at("configurations").as_array();
  std::vector<double> first, second, ratios;
  for (std::size_t k = 0; k < 5; ++k) {
    first.push_back(rows[0].at("runs").as_array().at(k).at("seconds").at("total").as_double());
    second.push_back(rows[1].at("runs").as_array().at(k).at("seconds").at("total").as_double());
    ratios.push_back(second[k] / first[k]);
  }
  for (auto* values : {&first, &second, &ratios}) std::sort(values->begin(), values->end());
  EXPECT_DOUBLE_EQ(rows[0].at("seconds").at("median").as_double(), first[2]);
  EXPECT_DOUBLE_EQ(rows[1].at("seconds").at("median").as_double(), second[2]);
  EXPECT_DOUBLE_EQ(rows[1].at("ratio").as_double(), ratios[2]);
  EXPECT_TRUE(rows[0].at("peak_memory_bytes").is_null());
}

TEST(BenchCommand, EveryRunStartsFromTheSameFirstEstimate) {
  const auto report =
      parse_json(cairn({"bench", "@manhattan:poses=80", "--initial", "spanning_tree", "--repeat",
                        "2", "--json", "-", "--no-memory"})
                     .out);
  const auto& rows = report.at("graphs").as_array().at(0).at("configurations").as_array();
  for (const auto& row : rows) {
    for (const auto& run : row.at("runs").as_array()) {
      EXPECT_EQ(run.at("chi2").at("initial").as_double(),
                rows[0].at("runs").as_array().at(0).at("chi2").at("initial").as_double());
      EXPECT_EQ(run.at("chi2").at("final").as_double(), row.at("chi2").at("final").as_double());
    }
  }
}

TEST(BenchCommand, ByDefaultComparesAllLinearSolversWithCairnsOwn) {
  const auto report = parse_json(
      cairn({"bench", "@ring:poses=60", "--repeat", "1", "--json", "-", "--no-memory"}).out);
  const auto& rows = report.at("graphs").as_array().at(0).at("configurations").as_array();
  EXPECT_EQ(rows.size(), Registry().names("linear_solver").size());
  EXPECT_EQ(rows[0].at("linear_solver").as_string(), "block_cholesky");
}

TEST(BenchCommand, FlagsAChi2ThatIsHigherThanTheOthers) {
  // One step of dogleg from a poor guess is not where three of Gauss-Newton end.
  const Outcome outcome = cairn(
      {"bench", "@manhattan:poses=200", "--optimizer",
       "gauss_newton,levenberg_marquardt:initial_lambda=1e6", "--linear-solver", "block_cholesky",
       "--iterations", "3", "--tolerance", "0", "--repeat", "1", "--json", "-", "--no-memory"});
  const auto report = parse_json(outcome.out);
  const auto& rows = report.at("graphs").as_array().at(0).at("configurations").as_array();
  EXPECT_TRUE(rows[0].at("chi2").at("agrees").as_bool());
  EXPECT_FALSE(rows[1].at("chi2").at("agrees").as_bool());
  EXPECT_GT(rows[1].at("chi2").at("relative_difference").as_double(), 1e-6);
}

TEST(BenchCommand, PrintsATableForEachGraph) {
  const Outcome outcome =
      cairn({"bench", "@ring:poses=60", "@ring:poses=40", "--repeat", "1", "--quiet"});
  EXPECT_THAT(outcome.out, HasSubstr("@ring:poses=60: 60 variables"));
  EXPECT_THAT(outcome.out, HasSubstr("@ring:poses=40: 40 variables"));
  EXPECT_THAT(outcome.out, HasSubstr("linear solver"));
}

TEST(BenchCommand, AWrongNameIsToldBeforeAnythingRuns) {
  const Outcome outcome =
      cairn({"bench", "@ring:poses=60", "--linear-solver", "block_cholesky,eigne"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("'eigen'"));
  EXPECT_EQ(outcome.out, "");
}

TEST(BenchCommand, AnInterruptReportsWhatWasMeasuredSoFar) {
  const TemporaryFolder folder;
  const Outcome outcome =
      cairn_interrupted({"bench", "@ring:poses=60", "--linear-solver", "block_cholesky", "--repeat",
                         "1000000", "--no-memory", "--json", folder.file("bench.json")},
                        "round 3 of 1000000", SIGINT);
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  const auto report = parse_json(read_text(folder.file("bench.json")));
  EXPECT_TRUE(report.at("interrupted").as_bool());
  const auto& row = report.at("graphs").as_array().at(0).at("configurations").as_array().at(0);
  EXPECT_GE(row.at("runs").as_array().size(), 2u);
  EXPECT_THAT(outcome.out, HasSubstr("block_cholesky"));
}

}  // namespace
}  // namespace cairn::test
