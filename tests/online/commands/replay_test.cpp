// SPDX-License-Identifier: BSD-3-Clause
// cairn replay GRAPH.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"
#include "support/plots.hpp"

namespace cairn::test {
namespace {

using testing::HasSubstr;
using testing::SizeIs;
using testing::StartsWith;

class Replay : public testing::Test {
 protected:
  void SetUp() override {
    if (!Registry().has("estimator", "batch")) GTEST_SKIP() << "there is no estimator batch";
  }
  TemporaryFolder folder_;
};

TEST_F(Replay, ReportsStepsPhasesAndChecks) {
  const std::string json = folder_.file("run.json"), csv = folder_.file("steps.csv");
  const Outcome run =
      cairn({"replay", "@manhattan:poses=80", "--estimator", "batch", "--check", "4", "--marginals",
             "diagonal", "--json", json, "--steps", csv, "-o", folder_.file("out.g2o"), "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("4 checks"));
  const boost::json::value report = parse_json(read_text(json));
  EXPECT_EQ(report.at("steps").at("count").as_int64(), 80);
  for (const char* part : {"median", "p95", "p99", "max"})
    EXPECT_GT(report.at("steps").at(part).as_double(), 0.0) << part;
  EXPECT_LE(report.at("steps").at("p95").as_double(), report.at("steps").at("p99").as_double());
  const double final = report.at("chi2").at("final").as_double();
  EXPECT_NEAR(final, report.at("chi2").at("batch").as_double(), 1e-6 * final);
  EXPECT_THAT(report.at("checks").as_array(), SizeIs(4));
  EXPECT_EQ(report.at("checks").at(3).at("step").as_int64(), 80);
  EXPECT_EQ(report.at("marginals_by").at("recomputation").as_int64(), 80);
  EXPECT_GT(report.at("seconds").at("marginals").as_double(), 0.0);
  const std::vector<std::string> rows = lines(read_text(csv));
  ASSERT_THAT(rows, SizeIs(81));
  EXPECT_THAT(rows[0],
              StartsWith("step,variables,factors,seconds,linearize,order,factorize,solve"));
  EXPECT_THAT(rows[80], StartsWith("80,80,"));
  EXPECT_EQ(cairn({"info", folder_.file("out.g2o")}).exit_code, 0);
}

// The states of a file do not follow what the estimator has made of the loop closures before.
TEST_F(Replay, TheStatesOfAFileTakeHardlyMoreWorkThanOdometry) {
  if (!Registry().has("estimator", "incremental_cholesky"))
    GTEST_SKIP() << "there is no estimator incremental_cholesky";
  const auto relinearized = [](const std::string& initial, const std::string& estimator) {
    const Outcome run = cairn({"replay", "@manhattan:poses=400", "--initial", initial,
                               "--estimator", estimator, "--json", "-", "--quiet"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return parse_json(run.out).at("relinearized_factors").as_int64();
  };
  const auto odometry = relinearized("odometry", "incremental_cholesky");
  EXPECT_LT(relinearized("as_given", "incremental_cholesky"), 2 * odometry + 100);
  EXPECT_GT(relinearized("as_given", "incremental_cholesky:hints=false"), 20 * odometry);
}

TEST_F(Replay, ComparesCovariancesWhereThatIsAskedFor) {
  const Outcome run =
      cairn({"replay", "@landmarks2d:poses=30", "--estimator", "batch", "--check", "2",
             "--covariance-check", "--marginals", "diagonal", "--json", "-", "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const boost::json::value report = parse_json(run.out);
  ASSERT_THAT(report.at("checks").as_array(), SizeIs(2));
  for (const boost::json::value& check : report.at("checks").as_array())
    EXPECT_LT(check.at("covariance_difference").as_double(), 1e-7);
}

TEST_F(Replay, SortsAFileThatIsInAnotherOrder) {
  const std::string sorted = folder_.file("sorted.g2o"), shuffled = folder_.file("shuffled.g2o");
  cairn({"generate", "manhattan:poses=40", "-o", sorted});
  std::vector<std::string> rows = lines(read_text(sorted));
  std::ranges::reverse(rows);
  std::string text;
  for (const std::string& row : rows) text += row + "\n";
  write_text(shuffled, text);
  const auto chi2 = [](const std::string& file, std::string* err) {
    const Outcome run = cairn({"replay", file, "--estimator", "batch", "--json", "-"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    if (err) *err = run.err;
    return parse_json(run.out).at("chi2").at("final").as_double();
  };
  std::string err;
  const double expected = chi2(sorted, nullptr);
  EXPECT_NEAR(chi2(shuffled, &err), expected, 1e-6 * expected);
  EXPECT_THAT(err, HasSubstr("sorted by the ids of its poses"));
}

TEST_F(Replay, SolvesLessOftenWhereThatIsWanted) {
  const Outcome run = cairn({"replay", "@manhattan:poses=30", "--estimator", "batch",
                             "--solve-every", "10", "--steps", folder_.file("s.csv"), "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  int solved = 0;
  for (const std::string& row : lines(read_text(folder_.file("s.csv"))))
    solved += row.find(",0,1,,none") == std::string::npos;
  EXPECT_EQ(solved, 1 + 3);  // the heading, and three steps with iterations
}

TEST_F(Replay, StartsFromTheFileOrFromOdometry) {
  for (const char* initial : {"odometry", "as_given"}) {
    const Outcome run =
        cairn({"replay", "@landmarks2d:poses=40", "--estimator", "batch", "--initial", initial,
               "--loss", "huber", "--check", "1", "--json", "-", "--quiet"});
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const boost::json::value report = parse_json(run.out);
    EXPECT_LT(report.at("checks").at(0).at("excess").as_double(), 1e-3) << initial;
  }
}

TEST_F(Replay, DrawsTheTimeOfEachStep) {
  if (!draws_plots()) GTEST_SKIP() << "nothing draws plots";
  const Outcome run = cairn({"replay", "@manhattan:poses=20", "--estimator", "batch", "--plot",
                             folder_.file("steps.svg"), "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(read_text(folder_.file("steps.svg")), HasSubstr("<svg"));
}

TEST_F(Replay, KeepsAFixedNumberOfPoses) {
  if (!Registry().has("sparsifier", "sparsify")) GTEST_SKIP() << "no sparsifier sparsify";
  const std::string out = folder_.file("out.g2o");
  const Outcome run =
      cairn({"replay", "@manhattan:poses=120,streets=3,loop_density=1", "--estimator", "batch",
             "--keep", "30", "--marginals", "last", "-o", out, "--json", "-", "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const boost::json::value report = parse_json(run.out);
  const boost::json::value& keep = report.at("keep");
  EXPECT_EQ(keep.at("removed").as_int64(), 90);
  EXPECT_EQ(keep.at("variables").as_int64(), 30);
  EXPECT_GT(keep.at("dropped").as_int64(), 0);
  EXPECT_GT(keep.at("kld").as_double(), 0.0);
  const boost::json::value info = parse_json(cairn({"info", out, "--json", "-"}).out);
  EXPECT_EQ(info.at("graph").at("variables").as_int64(), 30);
  const Outcome check = cairn({"replay", "@manhattan:poses=120", "--keep", "30", "--check", "2"});
  EXPECT_EQ(check.exit_code, 2);
  EXPECT_THAT(check.err, HasSubstr("omit one of them"));
}

TEST_F(Replay, EndsWithACodeWhereTheLastStepHasNotConverged) {
  const std::string json = folder_.file("run.json");
  const Arguments words{"replay", "@manhattan:poses=80", "--finish", "--json", json};
  const auto with = [&](const std::string& estimator) {
    Arguments all = words;
    all.insert(all.end(), {"--estimator", estimator});
    return cairn(all).exit_code;
  };
  EXPECT_EQ(with("batch"), 0);
  EXPECT_EQ(parse_json(read_text(json)).at("status"), "converged");
  EXPECT_EQ(with("batch:iterations=1"), 4);
  EXPECT_EQ(parse_json(read_text(json)).at("status"), "max_iterations");
}

TEST_F(Replay, SaysThatItsEstimateIsImplausible) {
  const std::string file = folder_.file("wrong.g2o");
  write_text(file,
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n"
             "EDGE_SE2 0 1 1 0 0 1e4 0 0 1e4 0 1e4\nEDGE_SE2 1 2 1 0 0 1e4 0 0 1e4 0 1e4\n"
             "EDGE_SE2 0 2 9 0 0 1e4 0 0 1e4 0 1e4\n");
  const Outcome run = cairn({"replay", file, "--estimator", "batch"});
  EXPECT_THAT(run.out, HasSubstr("times the 3 degrees of freedom"));
}

TEST_F(Replay, RefusesWhatCannotBe) {
  EXPECT_EQ(cairn({"replay", "@manhattan:poses=20", "--estimator", "no_such"}).exit_code, 5);
  const Outcome check =
      cairn({"replay", "@manhattan:poses=20", "--estimator", "batch", "--covariance-check"});
  EXPECT_EQ(check.exit_code, 2);
  EXPECT_THAT(check.err, HasSubstr("--marginals diagonal and --check N"));
}

}  // namespace
}  // namespace cairn::test
