// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <string>
#include <utility>

#include <boost/json/serialize.hpp>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

double final_chi2(const boost::json::value& report) {
  return report.at("chi2").at("final").as_double();
}

using OptimizeCommand = WithGraphFile;

TEST_F(OptimizeCommand, NamesTheErrorMetricWhereThereIsAChoice) {
  const std::string space = folder_.file("space.g2o"), plane = folder_.file("plane.g2o");
  write_text(space,
             "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"
             "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n");
  write_text(plane, "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n");
  EXPECT_EQ(report_of({"optimize", space}).at("graph").at("metric").as_string(), "rotation_vector");
  EXPECT_TRUE(report_of({"optimize", plane}).at("graph").at("metric").is_null());
  const Arguments old{"optimize", space, "--types", "slam3d:metric=logarithm"};
  EXPECT_EQ(report_of(old).at("graph").at("metric").as_string(), "logarithm");
  for (const char* command : {"optimize", "marginals", "replay"}) {
    EXPECT_THAT(unfolded(cairn({command, space}).out),
                HasSubstr("rotation_vector (default; formerly logarithm: --types "
                          "slam3d:metric=logarithm)"))
        << command;
    EXPECT_THAT(cairn({command, plane}).out, Not(HasSubstr("formerly"))) << command;
  }
}

TEST_F(OptimizeCommand, ReportsAllMembersThatScriptsRelyOn) {
  const std::string file = graph();
  const auto report = report_of({"optimize", file, "--threads", "2"});
  EXPECT_EQ(report.at("cairn").as_string(), "0.1.0");
  EXPECT_EQ(report.at("command").as_string(), "optimize");
  EXPECT_EQ(report.at("graph").at("file").as_string(), file);
  EXPECT_EQ(report.at("graph").at("variables").as_int64(), 200);
  EXPECT_EQ(report.at("graph").at("tangent_size").as_int64(), 600);
  EXPECT_EQ(report.at("graph").at("residual_size").as_int64(),
            3 * report.at("graph").at("factors").as_int64());
  EXPECT_EQ(report.at("optimizer").as_string(), "levenberg_marquardt");
  EXPECT_EQ(report.at("linear_solver").as_string(), "block_cholesky");
  EXPECT_EQ(report.at("threads").as_int64(), 2);
  EXPECT_EQ(report.at("status").as_string(), "converged");
  EXPECT_LT(final_chi2(report), report.at("chi2").at("initial").as_double());
  const auto& iterations = report.at("iterations").as_array();
  ASSERT_FALSE(iterations.empty());
  for (const auto& iteration : iterations) {
    EXPECT_TRUE(iteration.at("accepted").is_bool());
    for (const char* member : {"chi2", "step_norm", "lambda", "seconds"}) {
      EXPECT_TRUE(iteration.at(member).is_double()) << member;
    }
  }
  EXPECT_EQ(iterations.back().at("chi2").as_double(), final_chi2(report));
  for (const char* part :
       {"read", "total", "linearize", "analyze", "factorize", "solve", "update"}) {
    EXPECT_TRUE(report.at("seconds").at(part).is_double()) << part;
  }
  EXPECT_FALSE(report.at("solver").at("ordering").as_string().empty());
  EXPECT_GT(report.at("solver").at("factor_nonzeros").as_int64(), 600);
  EXPECT_TRUE(report.at("solver").at("factor_flops").is_double());
  EXPECT_GT(report.at("peak_memory_bytes").as_int64(), 1000000);
  EXPECT_FALSE(report.at("machine").at("cpu").as_string().empty());
  EXPECT_GE(report.at("machine").at("cores").to_number<int>(), 1);
  for (const char* member : {"compiler", "flags", "simd"}) {
    EXPECT_TRUE(report.at("build").at(member).is_string()) << member;
  }
}

TEST_F(OptimizeCommand, ReportsTheInnerIterationsOfAnIterativeSolverOnly) {
  const std::string file = graph();
  Registry registry;
  if (!registry.has("linear_solver", "pcg")) GTEST_SKIP();
  const auto report = report_of({"optimize", file, "--linear-solver", "pcg:tolerance=1e-8"});
  const auto& solver = report.at("solver").as_object();
  EXPECT_GT(solver.at("iterations").as_int64(), 0);
  EXPECT_GT(solver.at("relative_residual").as_double(), 0.0);
  EXPECT_LE(solver.at("relative_residual").as_double(), 1e-8);
  const Outcome text = cairn({"optimize", file, "--linear-solver", "pcg", "--quiet"});
  EXPECT_THAT(text.out, HasSubstr("relative residual at most"));
  const auto direct = report_of({"optimize", file});
  EXPECT_FALSE(direct.at("solver").as_object().contains("iterations"));
}

TEST_F(OptimizeCommand, WritesTheEstimateThatItReports) {
  const std::string best = folder_.file("best.g2o");
  const double chi2 = final_chi2(report_of({"optimize", graph(), "-o", best}));
  const double as_given = report_of({"info", best}).at("chi2").at("initial").as_double();
  EXPECT_NEAR(as_given / chi2, 1.0, 1e-9);
}

TEST_F(OptimizeCommand, TheEstimateIsTheSameToTheLastByteForAnyNumberOfThreads) {
  for (const char* kind : {"@manhattan:poses=1500", "@sphere"}) {
    std::vector<std::string> estimates;
    for (const std::string threads : {"1", "2", "3"}) {
      const Outcome outcome = cairn({"optimize", kind, "-o", "-", "--to", "g2o", "--iterations",
                                     "3", "--tolerance", "0", "--threads", threads, "--quiet"});
      EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
      EXPECT_THAT(outcome.out, HasSubstr("VERTEX_SE"));
      estimates.push_back(outcome.out);
    }
    EXPECT_TRUE(estimates[0] == estimates[1]) << kind << ": 1 and 2 threads differ";
    EXPECT_TRUE(estimates[0] == estimates[2]) << kind << ": 1 and 3 threads differ";
  }
}

TEST_F(OptimizeCommand, AllLinearSolversAndOptimizersReachTheSameChi2) {
  const std::string file = graph();
  const double expected = final_chi2(report_of({"optimize", file}));
  const Registry registry;
  for (const std::string& solver : registry.names("linear_solver")) {
    EXPECT_NEAR(final_chi2(report_of({"optimize", file, "--linear-solver", solver})) / expected, 1,
                1e-8)
        << solver;
  }
  for (const std::string& optimizer : registry.names("optimizer")) {
    EXPECT_NEAR(final_chi2(report_of({"optimize", file, "--initial", "chordal", "--iterations",
                                      "5000", "--optimizer", optimizer})) /
                    expected,
                1, 1e-8)
        << optimizer;
  }
}

TEST_F(OptimizeCommand, OptionsOfASolverFollowItsName) {
  const auto report =
      report_of({"optimize", graph(), "--linear-solver", "block_cholesky:ordering=natural"});
  EXPECT_EQ(report.at("solver").at("ordering").as_string(), "natural");
  const Outcome wrong =
      cairn({"optimize", graph(), "--linear-solver", "block_cholesky:odering=amd"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("'ordering'"));
}

TEST_F(OptimizeCommand, ToleranceZeroRunsExactlyThatManyIterations) {
  const auto report = report_of({"optimize", graph(), "--tolerance", "0", "--iterations", "12"});
  EXPECT_EQ(report.at("iterations").as_array().size(), 12u);
  EXPECT_EQ(report.at("status").as_string(), "max_iterations");
}

TEST_F(OptimizeCommand, ALossOnLoopsTamesOutliers) {
  const std::string bad = "@manhattan:poses=200,outliers=20,seed=1";
  // 20 iterations, since it converges slowly.
  const auto plain = report_of(
      {"optimize", bad, "--initial", "odometry", "--iterations", "20", "--tolerance", "0"});
  const auto robust = report_of(
      {"optimize", bad, "--initial", "odometry", "--loss", "cauchy", "--loss-on", "loops"});
  EXPECT_TRUE(plain.at("loss").is_null());
  EXPECT_EQ(robust.at("loss").as_string(), "cauchy");
  EXPECT_LT(final_chi2(robust), 0.5 * final_chi2(plain));
  const Outcome without = cairn({"optimize", bad, "--loss-on", "loops"});
  EXPECT_EQ(without.exit_code, 2);
  const Outcome misspelt = cairn({"optimize", bad, "--loss", "cauchy", "--loss-on", "loop"});
  EXPECT_EQ(misspelt.exit_code, 2);
  EXPECT_THAT(misspelt.err, HasSubstr("'loop' is neither all, loops nor a type of factors"));
  const Outcome none = cairn({"optimize", bad, "--loss", "cauchy", "--loss-on", "EDGE_SE2_XY"});
  EXPECT_THAT(none.err, HasSubstr("--loss-on selects no factor of this graph"));
}

TEST_F(OptimizeCommand, TheResultsShowWhichStartWasTakenAndWhatDecided) {
  if (!Registry().has("initial_guess", "auto")) GTEST_SKIP() << "there is no initial guess auto";
  const Outcome run = cairn({"optimize", "@manhattan:poses=400,rotation_sigma=0.1", "--quiet"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(unfolded(run.out), HasSubstr("start chordal (chi2 "));
  EXPECT_THAT(unfolded(run.out), HasSubstr("; not as_given (chi2 "));
  const Outcome near = cairn({"optimize", graph(), "--quiet"});
  EXPECT_THAT(unfolded(near.out), HasSubstr("start as_given (chi2 "));
  EXPECT_THAT(unfolded(near.out), HasSubstr("no measurement disagrees with its angles"));
}

TEST_F(OptimizeCommand, SaysHowManyLoopClosuresALossRejectsAndThatNoFileHasIt) {
  if (!Registry().has("loss", "tukey")) GTEST_SKIP() << "there is no loss tukey";
  const std::string file = folder_.file("best.g2o");
  const auto report = report_of({"optimize", "@ring:poses=170,outliers=5", "--loss", "tukey",
                                 "--loss-on", "loops", "-o", file});
  std::string notes;
  for (const auto& note : report.at("notes").as_array()) notes += note.as_string().c_str();
  EXPECT_THAT(notes, HasSubstr("loop closures less than 1 % of their weight"));
  EXPECT_THAT(notes, HasSubstr("are not in the file: no format has them"));
  EXPECT_THAT(notes, Not(HasSubstr("hardly")));
  EXPECT_TRUE(report.at("doubts").as_array().empty()) << boost::json::serialize(report);
}

TEST_F(OptimizeCommand, WhatSpeaksAgainstTheEstimateIsTheDoubtsOfTheReport) {
  const std::string file = folder_.file("contradiction.g2o");
  write_text(file,
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"
             "EDGE_SE2 0 1 90 0 0 1 0 0 1 0 1\n");
  const auto report = report_of({"optimize", file});
  ASSERT_EQ(report.at("doubts").as_array().size(), 1U) << boost::json::serialize(report);
  const std::string doubt(report.at("doubts").at(0).as_string());
  EXPECT_THAT(doubt, HasSubstr("hardly the right one"));
  EXPECT_THAT(boost::json::serialize(report.at("notes")), HasSubstr("anchored"));
  EXPECT_THAT(unfolded(cairn({"optimize", file, "--quiet"}).out),
              AllOf(HasSubstr("doubt chi2 is "), HasSubstr("note ")));
}

TEST_F(OptimizeCommand, AnOptimizerThatTakesNoLinearSolverSaysWhatToUseInstead) {
  if (!Registry().has("optimizer", "ceres")) GTEST_SKIP() << "built without Ceres";
  const Outcome outcome =
      cairn({"optimize", graph(), "--optimizer", "ceres", "--linear-solver", "cholmod"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--optimizer ceres:linear_solver_type="));
}

TEST_F(OptimizeCommand, TheLinearSolverMayBeGivenOnceOnly) {
  const Outcome outcome =
      cairn({"optimize", graph(), "--optimizer", "gauss_newton:linear_solver=eigen",
             "--linear-solver", "block_cholesky"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("twice"));
  const auto by_option =
      report_of({"optimize", graph(), "--optimizer", "gauss_newton:linear_solver=eigen"});
  EXPECT_EQ(by_option.at("linear_solver").as_string(), "eigen");
}

TEST_F(OptimizeCommand, ReadsStandardInputAndWritesStandardOutput) {
  const std::string file = graph();
  const Outcome piped =
      cairn({"optimize", "-", "-o", "-", "--to", "g2o", "--quiet"}, {}, read_text(file));
  EXPECT_EQ(piped.exit_code, 0) << piped.err;
  const std::string best = folder_.file("best.g2o");
  report_of({"optimize", file, "-o", best});
  EXPECT_TRUE(piped.out == read_text(best));
  const Outcome both = cairn({"optimize", file, "-o", "-", "--to", "g2o", "--json", "-"});
  EXPECT_EQ(both.exit_code, 2);
}

TEST_F(OptimizeCommand, AnOutputThatCannotBeWrittenIsToldBeforeTheWork) {
  const Outcome ending = cairn({"optimize", graph(), "-o", folder_.file("best.docx")});
  EXPECT_EQ(ending.exit_code, 2);
  EXPECT_THAT(ending.err, HasSubstr(".docx"));
  EXPECT_THAT(ending.err, Not(HasSubstr("iteration")));
  const Outcome nowhere = cairn({"optimize", graph(), "-o", folder_.file("none/best.g2o")});
  EXPECT_EQ(nowhere.exit_code, 3);
  EXPECT_THAT(nowhere.err, Not(HasSubstr("iteration")));
}

TEST_F(OptimizeCommand, AFailureLeavesTheOldFileAsItWas) {
  const std::string best = folder_.file("best.g2o");
  write_text(best, "an older result\n");
  write_text(folder_.file("bad.g2o"), "VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 9 1 0 0 1 0 0 1 0 1\n");
  const auto before = folder_.contents();
  EXPECT_EQ(cairn({"optimize", folder_.file("bad.g2o"), "-o", best}).exit_code, 3);
  EXPECT_EQ(read_text(best), "an older result\n");
  EXPECT_EQ(folder_.contents(), before);
}

TEST_F(OptimizeCommand, ADivergingRunExitsWithFourAndStillWritesItsBest) {
  // The square of such a distance is no number any more.
  const std::string far = folder_.file("far.g2o"), best = folder_.file("best.g2o");
  write_text(far, "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1e200 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n");
  const Outcome outcome = cairn(
      {"optimize", far, "--initial", "as_given", "-o", best, "--json", folder_.file("run.json")});
  EXPECT_EQ(outcome.exit_code, 4) << outcome.err;
  const auto report = parse_json(read_text(folder_.file("run.json")));
  EXPECT_EQ(report.at("status").as_string(), "diverged");
  EXPECT_TRUE(report.at("chi2").at("initial").is_null());
  EXPECT_THAT(read_text(best), HasSubstr("VERTEX_SE2 1 1e+200 "));
}

TEST_F(OptimizeCommand, AnInterruptEndsWithTheBestEstimateWritten) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::string best = folder_.file("best.g2o"), json = folder_.file("run.json");
    const Outcome outcome = cairn_interrupted({"optimize", graph(), "-o", best, "--json", json,
                                               "--tolerance", "0", "--iterations", "1000000000"},
                                              "iteration   2 ", signal);
    EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
    const auto report = parse_json(read_text(json));
    EXPECT_EQ(report.at("status").as_string(), "interrupted");
    EXPECT_LT(final_chi2(report), report.at("chi2").at("initial").as_double());
    const double written = report_of({"info", best}).at("chi2").at("initial").as_double();
    EXPECT_NEAR(written / final_chi2(report), 1.0, 1e-9);
    std::filesystem::remove(best);
  }
}

TEST_F(OptimizeCommand, StopsAtALimitOfTime) {
  const Outcome outcome =
      cairn({"optimize", "@manhattan:poses=200", "--max-seconds", "1e-9", "--json", "-"});
  EXPECT_EQ(outcome.exit_code, 4);
  const auto report = parse_json(outcome.out);
  EXPECT_EQ(report.at("status").as_string(), "max_iterations");
  EXPECT_TRUE(report.at("iterations").as_array().empty());
  const Outcome text =
      cairn({"optimize", "@manhattan:poses=200", "--max-seconds", "1e-9", "--quiet"});
  EXPECT_THAT(text.out, HasSubstr("stopped by the limit of 1e-09 s"));
}

TEST_F(OptimizeCommand, WhatHasNotConvergedIsSaidAndIsNoSuccess) {
  const std::string best = folder_.file("best.g2o");
  const Outcome outcome = cairn({"optimize", graph(), "--iterations", "1", "-o", best, "--quiet"});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.out, HasSubstr("stopped by --iterations 1 before it converged"));
  EXPECT_TRUE(std::filesystem::exists(best));
}

TEST_F(OptimizeCommand, AnImplausibleEstimateIsSaid) {
  const std::string bad = "@manhattan:poses=200,outliers=20,seed=1";
  const Outcome plain = cairn({"optimize", bad, "--quiet"});
  EXPECT_EQ(plain.exit_code, 0) << plain.err;
  EXPECT_THAT(plain.out, HasSubstr("degrees of freedom: this estimate is hardly the right one"));
  const Outcome good = cairn({"optimize", "@manhattan:poses=200", "--quiet"});
  EXPECT_THAT(good.out, Not(HasSubstr("degrees of freedom")));
}

TEST_F(OptimizeCommand, AnImplausibleEstimateIsSaidByOtherCommandsToo) {
  const std::string bad = folder_.file("bad.g2o"), map = folder_.file("map.g2o");
  ASSERT_EQ(cairn({"generate", "manhattan:poses=200,outliers=20", "-o", bad}).exit_code, 0);
  const std::vector<Arguments> commands{
      {"bench", bad, "--repeat", "1", "--linear-solver", "block_cholesky", "--no-memory"},
      {"sparsify", bad, "-o", map},
      {"replay", bad, "-o", map, "--finish"},
      {"marginals", bad}};
  for (const Arguments& arguments : commands) {
    const Outcome outcome = cairn(arguments);
    EXPECT_THAT(outcome.out + outcome.err,
                HasSubstr("degrees of freedom: this estimate is hardly the right one"))
        << arguments.front();
  }
  const Outcome online = cairn({"online", "-o", map}, {}, read_text(bad));
  EXPECT_THAT(online.err, HasSubstr("degrees of freedom: this estimate is hardly the right one"));
}

TEST_F(OptimizeCommand, TheStartIsChosenByDefaultAndSaid) {
  const std::string far = "@manhattan:poses=1500,rotation_sigma=0.1";
  const auto report = report_of({"optimize", far});
  EXPECT_EQ(report.at("initial").as_string(), "auto");
  EXPECT_THAT(std::string(report.at("initial_notes").at(0).as_string()),
              HasSubstr("chordal (chi2"));
  const auto chordal = report_of({"optimize", far, "--initial", "chordal"});
  EXPECT_EQ(final_chi2(report), final_chi2(chordal));
  const auto given = report_of(
      {"optimize", far, "--initial", "as_given", "--iterations", "50", "--tolerance", "0"});
  EXPECT_LT(final_chi2(report), 0.7 * final_chi2(given));
}

TEST_F(OptimizeCommand, NamesTheGraphByItsFile) {
  const TemporaryFolder folder;
  const std::string file = folder.file("ring.g2o");
  ASSERT_EQ(cairn({"generate", "ring:poses=30", "-o", file}).exit_code, 0);
  for (const char* command : {"optimize", "info"}) {
    const Outcome outcome = cairn({command, file, "--quiet"});
    EXPECT_THAT(outcome.out, HasSubstr("ring.g2o"));
    EXPECT_THAT(outcome.out, Not(HasSubstr(folder.path().string())));
    const auto graph = report_of({command, file}).at("graph");
    EXPECT_EQ(graph.at("name").as_string(), "ring.g2o");
    EXPECT_EQ(graph.at("file").as_string(), file);
  }
}

/// A step that a heavy damping or a small trust region makes short is no convergence.
TEST(ShortSteps, AreNotTakenForConvergence) {
  const Registry registry;
  for (const auto& [name, option] : {std::pair{"levenberg_marquardt", ":initial_lambda=1e16"},
                                     {"ceres", ":initial_radius=1e-30"}}) {
    if (!registry.has("optimizer", name)) continue;
    const Outcome run = cairn({"optimize", "@manhattan:poses=60", "--initial", "as_given",
                               "--optimizer", std::string(name) + option});
    EXPECT_EQ(run.exit_code, 4) << name << ": " << run.out;
    EXPECT_EQ(
        cairn({"optimize", "@manhattan:poses=60", "--initial", "as_given", "--optimizer", name})
            .exit_code,
        0)
        << name;
  }
}

}  // namespace
}  // namespace cairn::test
