// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>

#include "cairn/linear/iterative_solver.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "integration/latex_tabular.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAreArray;

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

TEST(BenchCommand, ATableThatGoesIntoAFileHasAllColumnsHoweverWide) {
  const Outcome outcome =
      cairn({"bench", "@ring:poses=40", "--linear-solver",
             "block_cholesky,block_cholesky:ordering=amd,eigen", "--repeat", "1", "--no-memory"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* column : {"min … max", "ms/it", "nnz(L)", "memory"})
    EXPECT_THAT(outcome.out, HasSubstr(column));
  EXPECT_THAT(outcome.out, Not(HasSubstr("no room for")));
}

TEST(BenchCommand, ATableOfLatexHasAllColumnsAndEscapesWhatHasAMeaningThere) {
  const Outcome outcome = cairn({"bench", "@ring:poses=40", "--linear-solver", "block_cholesky",
                                 "--repeat", "1", "--no-memory", "--latex", "-"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("% @ring:poses=40\n\\begin{tabular}{lrrrrrrrrrl}\n\\hline\n"));
  EXPECT_THAT(outcome.out,
              HasSubstr("linear solver & median & min \\dots{} max & ratio & ms/it & "));
  EXPECT_THAT(outcome.out, HasSubstr("\nblock\\_cholesky & "));
  EXPECT_EQ(latex_tabular(outcome.out).rows.size(), 2U);
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

TEST(BenchCommand, ByDefaultComparesAllDirectLinearSolversWithCairnsOwn) {
  const Outcome outcome =
      cairn({"bench", "@ring:poses=60", "--repeat", "1", "--json", "-", "--no-memory"});
  const auto report = parse_json(outcome.out);
  std::vector<std::string> direct, iterative, rows, left_out;
  Registry registry;
  for (const std::string& name : registry.names("linear_solver")) {
    const auto solver = registry.make<LinearSolver>(name);
    (query<IterativeSolver>(*solver) ? iterative : direct).push_back(name);
  }
  for (const auto& row : report.at("graphs").at(0).at("configurations").as_array())
    rows.emplace_back(row.at("linear_solver").as_string());
  for (const auto& name : report.at("left_out").as_array()) left_out.emplace_back(name.as_string());
  EXPECT_EQ(rows.front(), "block_cholesky");
  EXPECT_THAT(rows, UnorderedElementsAreArray(direct));
  EXPECT_EQ(left_out, iterative);
  for (const char* name : {"pcg", "jacobi", "gauss_seidel"}) {
    if (!registry.has("linear_solver", name)) continue;
    EXPECT_THAT(left_out, Contains(name));
    EXPECT_THAT(outcome.err, HasSubstr(name));
  }
  EXPECT_THAT(outcome.err, HasSubstr("note: left out as iterative: "));
}

TEST(BenchCommand, AnIterativeSolverThatIsNamedIsCompared) {
  if (!Registry().has("linear_solver", "pcg")) GTEST_SKIP();
  const auto report = report_of({"bench", "@ring:poses=40", "--repeat", "1", "--no-memory",
                                 "--linear-solver", "block_cholesky,pcg"});
  EXPECT_EQ(report.at("graphs").at(0).at("configurations").as_array().size(), 2u);
  EXPECT_TRUE(report.at("left_out").as_array().empty());
}

TEST(BenchCommand, ARunThatTakesTooLongIsStoppedAndItsRowSaysSo) {
  const TemporaryFolder folder;
  const Arguments run{"bench",           "@manhattan:poses=200",
                      "--linear-solver", "eigen",
                      "--max-seconds",   "1e-9",
                      "--repeat",        "2",
                      "--json",          folder.file("bench.json")};
  const Outcome outcome = cairn(run);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("time limit"));
  const auto report = parse_json(read_text(folder.file("bench.json")));
  EXPECT_EQ(report.at("max_seconds").as_double(), 1e-9);
  const auto& row = report.at("graphs").at(0).at("configurations").at(0);
  ASSERT_EQ(row.at("runs").as_array().size(), 2u);
  for (const auto& one : row.at("runs").as_array()) EXPECT_TRUE(one.at("out_of_time").as_bool());
  EXPECT_EQ(row.at("iterations").to_number<int>(), 0);
  EXPECT_GT(row.at("peak_memory_bytes").to_number<double>(), 0.0);

  const auto patient = report_of({"bench", "@ring:poses=40", "--linear-solver", "eigen",
                                  "--max-seconds", "1000", "--repeat", "1", "--no-memory"});
  const auto& ended = patient.at("graphs").at(0).at("configurations").at(0);
  EXPECT_FALSE(ended.at("runs").at(0).at("out_of_time").as_bool());
  EXPECT_EQ(ended.at("status").as_string(), "converged");
}

TEST(BenchCommand, ABrokenPluginLeavesARowThatSaysSo) {
  const TemporaryFolder folder;
  const std::string fragile = bad_plugins() + "/solver_throws/fragile.so";
  for (const std::string where : {"construction", "analyze", "factorize", "number"}) {
    SCOPED_TRACE(where);
    const Outcome outcome =
        cairn({"bench", "@ring:poses=40", "--repeat", "2", "--no-memory", "--quiet", "--plugin",
               fragile, "--linear-solver", "block_cholesky,fragile:in=" + where + ",eigen",
               "--json", folder.file("b.json")});
    EXPECT_EQ(outcome.exit_code, 5) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("failed"));
    EXPECT_THAT(outcome.out, HasSubstr("linear solver 'fragile"));
    const auto report = parse_json(read_text(folder.file("b.json")));
    const auto& rows = report.at("graphs").at(0).at("configurations").as_array();
    ASSERT_EQ(rows.size(), 3u);
    EXPECT_EQ(rows[0].at("runs").as_array().size(), 2u);
    EXPECT_EQ(rows[1].at("runs").as_array().size(), 0u);
    EXPECT_THAT(std::string(rows[1].at("error").as_string()), HasSubstr("fragile"));
    EXPECT_EQ(rows[2].at("runs").as_array().size(), 2u);
    EXPECT_TRUE(rows[2].at("error").is_null());
  }
}

TEST(BenchCommand, AnOptimizerWhosePluginCannotBeOpenedHasOneRow) {
  const TemporaryFolder folder;
  write_text(folder.file("hollow.so"), "no shared object");
  write_text(folder.file("hollow.json"),
             R"({"name": "hollow", "version": "1", "licence": "", "description": "",
                 "file": "hollow.so",
                 "offers": [{"kind": "optimizer", "name": "hollow", "summary": ""}]})");
  const Outcome outcome = cairn({"bench", "@ring:poses=40", "--repeat", "1", "--no-memory",
                                 "--optimizer", "hollow,levenberg_marquardt", "--linear-solver",
                                 "block_cholesky,eigen", "--json", folder.file("b.json")},
                                {{"CAIRN_PLUGIN_PATH", folder.path().string()}});
  EXPECT_EQ(outcome.exit_code, 5) << outcome.err;
  const auto report = parse_json(read_text(folder.file("b.json")));
  const auto& rows = report.at("graphs").at(0).at("configurations").as_array();
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_THAT(std::string(rows[0].at("error").as_string()), HasSubstr("hollow.so"));
  EXPECT_EQ(rows[1].at("runs").as_array().size(), 1u);
  EXPECT_EQ(rows[2].at("runs").as_array().size(), 1u);
}

TEST(BenchCommand, NamesGraphsByTheirFiles) {
  const TemporaryFolder folder;
  for (const char* name : {"a", "b"}) {
    std::filesystem::create_directory(folder.path() / name);
    ASSERT_EQ(cairn({"generate", "ring:poses=30", "-o", folder.file(name) + "/ring.g2o"}).exit_code,
              0);
  }
  std::filesystem::copy_file(folder.file("a/ring.g2o"), folder.file("lap.g2o"));
  const std::string a = folder.file("a/ring.g2o"), b = folder.file("b/ring.g2o"),
                    lap = folder.file("lap.g2o");
  const auto names = [&](Arguments more) {
    Arguments run{"bench",
                  "--linear-solver",
                  "eigen",
                  "--repeat",
                  "1",
                  "--no-memory",
                  "--quiet",
                  "--csv",
                  folder.file("runs.csv"),
                  "--json",
                  folder.file("bench.json")};
    run.insert(run.end(), more.begin(), more.end());
    const Outcome outcome = cairn(run);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    std::vector<std::string> all;
    const auto csv = lines(read_text(folder.file("runs.csv")));
    const auto report = parse_json(read_text(folder.file("bench.json")));
    std::size_t line = 0;
    for (const auto& graph : report.at("graphs").as_array()) {
      all.emplace_back(graph.at("graph").at("name").as_string());
      EXPECT_THAT(outcome.out, HasSubstr(all.back() + ": 30 variables"));
      EXPECT_THAT(csv.at(++line), StartsWith(all.back() + ","));
    }
    EXPECT_EQ(report.at("graphs").at(0).at("graph").at("file").as_string(), more.front());
    return all;
  };
  EXPECT_THAT(names({lap, a}), ElementsAre("lap.g2o", "ring.g2o"));
  EXPECT_THAT(names({a, lap, b}), ElementsAre("a/ring.g2o", "lap.g2o", "b/ring.g2o"));
  EXPECT_THAT(names({a, b, "--name", "first"}), ElementsAre("first", "b/ring.g2o"));
  const Outcome many = cairn({"bench", a, "--name", "x", "--name", "y"});
  EXPECT_EQ(many.exit_code, 2);
  EXPECT_THAT(many.err, HasSubstr("--name is given 2 times for 1 graph"));
}

TEST(BenchCommand, LabelsLeaveOutWhatAllConfigurationsHave) {
  const auto labels = [](const std::string& optimizers, const std::string& solvers) {
    const auto report = report_of({"bench", "@ring:poses=30", "--repeat", "1", "--no-memory",
                                   "--optimizer", optimizers, "--linear-solver", solvers});
    std::vector<std::string> all;
    for (const auto& row : report.at("graphs").at(0).at("configurations").as_array())
      all.emplace_back(row.at("label").as_string());
    return all;
  };
  EXPECT_THAT(labels("dogleg", "eigen,block_cholesky"), ElementsAre("eigen", "block_cholesky"));
  EXPECT_THAT(labels("dogleg,gauss_newton", "eigen"), ElementsAre("dogleg", "gauss_newton"));
  EXPECT_THAT(labels("dogleg", "eigen"), ElementsAre("dogleg, eigen"));
  EXPECT_THAT(labels("dogleg,gauss_newton", "eigen,block_cholesky"),
              ElementsAre("dogleg, eigen", "dogleg, block_cholesky", "gauss_newton, eigen",
                          "gauss_newton, block_cholesky"));
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

TEST(BenchCommand, AnInterruptEndsTheProcessThatMeasuresMemory) {
  // Sent to the program alone, as by a container or a script; its child would run for days.
  const Outcome outcome = cairn_interrupted({"bench", "@ring:poses=60", "--linear-solver", "eigen",
                                             "--iterations", "1000000000", "--tolerance", "0"},
                                            "memory", SIGINT);
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("not run"));
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
