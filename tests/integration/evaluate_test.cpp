// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

boost::json::value errors(const std::string& estimate, const std::string& truth) {
  const Outcome outcome = cairn({"evaluate", estimate, truth, "--json", "-"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  return parse_json(outcome.out);
}

double number(const boost::json::value& report, const char* error, const char* part) {
  return report.at(error).at(part).as_double();
}

TEST(EvaluateCommand, OptimisingBringsTheEstimateNearerToTheTruth) {
  const TemporaryFolder folder;
  const std::string graph = folder.file("graph.g2o"), truth = folder.file("truth.g2o"),
                    best = folder.file("best.g2o");
  ASSERT_EQ(
      cairn({"generate", "manhattan:poses=300", "-o", graph, "--ground-truth", truth}).exit_code,
      0);
  ASSERT_EQ(cairn({"optimize", graph, "-o", best}).exit_code, 0);
  const auto before = errors(graph, truth), after = errors(best, truth),
             itself = errors(truth, truth);
  for (const char* error : {"ate", "rpe_all"}) {
    EXPECT_LT(number(after, error, "translation"), number(before, error, "translation")) << error;
    EXPECT_LT(number(after, error, "rotation"), number(before, error, "rotation")) << error;
  }
  for (const char* error : {"ate", "rpe", "rpe_all"}) {
    EXPECT_NEAR(number(itself, error, "translation"), 0.0, 1e-9) << error;
  }
  EXPECT_EQ(after.at("poses").at("compared").as_int64(), 300);
}

TEST(EvaluateCommand, ARigidMotionIsNoError) {
  const TemporaryFolder folder;
  write_text(folder.file("a.g2o"), "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 1 2 0\n");
  // The same, turned by a quarter and moved by (5, -3).
  write_text(folder.file("b.g2o"),
             "VERTEX_SE2 0 5 -3 1.5707963267948966\nVERTEX_SE2 1 5 -2 1.5707963267948966\n"
             "VERTEX_SE2 2 3 -2 1.5707963267948966\n");
  const auto report = errors(folder.file("a.g2o"), folder.file("b.g2o"));
  EXPECT_NEAR(number(report, "ate", "translation"), 0.0, 1e-12);
  EXPECT_NEAR(number(report, "ate", "rotation"), 0.0, 1e-6);
}

TEST(EvaluateCommand, PosesInOnlyOneOfTheFilesAreTold) {
  const TemporaryFolder folder;
  write_text(folder.file("a.g2o"), "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 1 2 0\n");
  write_text(folder.file("b.g2o"),
             "VERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 1 2 0\nVERTEX_SE2 8 1 2 0\nVERTEX_SE2 9 1 2 0\n");
  const Outcome outcome = cairn({"evaluate", folder.file("a.g2o"), folder.file("b.g2o")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("1 pose of " + folder.file("a.g2o")));
  EXPECT_THAT(outcome.err, HasSubstr("2 poses of " + folder.file("b.g2o")));
  EXPECT_THAT(outcome.out, HasSubstr("2 poses compared"));
  const auto report = errors(folder.file("a.g2o"), folder.file("b.g2o"));
  EXPECT_EQ(report.at("poses").at("only_in_truth").as_int64(), 2);
}

TEST(EvaluateCommand, NothingInCommonIsAnError) {
  const TemporaryFolder folder;
  write_text(folder.file("a.g2o"), "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n");
  write_text(folder.file("b.g2o"), "VERTEX_SE2 5 0 0 0\nVERTEX_SE2 6 1 0 0\n");
  EXPECT_EQ(cairn({"evaluate", folder.file("a.g2o"), folder.file("b.g2o")}).exit_code, 3);
}

}  // namespace
}  // namespace cairn::test
