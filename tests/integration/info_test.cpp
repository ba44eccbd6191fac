// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class InfoCommand : public ::testing::Test {
 protected:
  boost::json::value info_of(const std::string& text, const Arguments& more = {}) {
    write_text(folder_.file("graph.g2o"), text);
    Arguments arguments{"info", folder_.file("graph.g2o"), "--json", "-"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return parse_json(outcome.out);
  }
  std::string suspicions(const boost::json::value& report) {
    std::string all;
    for (const auto& sentence : report.at("suspicions").as_array())
      all += sentence.as_string().c_str() + std::string("\n");
    return all;
  }
  TemporaryFolder folder_;
};

const std::string kIdentity = " 1 0 0 1 0 1\n";
/// Three poses in a row, one metre apart, and an odometry that says so but for 0.1 m in the second
/// step.
const std::string kChain =
    "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n"
    "EDGE_SE2 0 1 1 0 0" +
    kIdentity + "EDGE_SE2 1 2 1.1 0 0" + kIdentity;

TEST_F(InfoCommand, GivesNoShareOfWhatOverflows) {
  write_text(folder_.file("graph.g2o"),
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1e308 0 0\nEDGE_SE2 0 1 1 0 0" + kIdentity +
                 "EDGE_SE2 0 1 2 0 0" + kIdentity);
  const Outcome outcome = cairn({"info", folder_.file("graph.g2o")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("worst factors"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("nan")));
  EXPECT_THAT(outcome.out, Not(HasSubstr("inf %")));
  EXPECT_THAT(outcome.out, Not(HasSubstr("inf per degree")));
}

TEST_F(InfoCommand, CountsWhatIsThere) {
  const auto report = info_of(kChain + "EDGE_SE2 0 2 2 0 0" + kIdentity);
  EXPECT_EQ(report.at("variables").as_array().at(0).at("type").as_string(), "VERTEX_SE2");
  EXPECT_EQ(report.at("variables").as_array().at(0).at("count").as_int64(), 3);
  EXPECT_EQ(report.at("factors").as_array().at(0).at("count").as_int64(), 3);
  EXPECT_EQ(report.at("odometry").as_int64(), 2);
  EXPECT_EQ(report.at("loop_closures").as_int64(), 1);
  EXPECT_EQ(report.at("components").as_int64(), 1);
  EXPECT_EQ(report.at("gauge").at("freedoms").as_int64(), 3);
  EXPECT_EQ(report.at("gauge").at("anchored").as_array().at(0).as_int64(), 0);
  EXPECT_EQ(report.at("degrees_of_freedom").as_int64(), 9 - 6);
  EXPECT_NEAR(report.at("chi2").at("initial").as_double(), 0.01, 1e-12);
  EXPECT_EQ(report.at("worst").as_array().at(0).at("factor").as_string(), "EDGE_SE2 1 2");
}

TEST_F(InfoCommand, AFixedVariableLeavesNoGaugeFreedom) {
  const auto report = info_of(kChain + "FIX 1\n");
  EXPECT_EQ(report.at("gauge").at("freedoms").as_int64(), 0);
  EXPECT_EQ(report.at("variables").as_array().at(0).at("fixed").as_int64(), 1);
}

TEST_F(InfoCommand, SaysWhatLooksWrong) {
  const auto report =
      info_of(kChain + "EDGE_SE2 2 1 -1 0 0" + kIdentity +  // doubled, the other way round
              "VERTEX_SE2 7 5 5 0\n" +                      // touched by nothing
              "VERTEX_SE2 8 5 6 0\nVERTEX_SE2 9 6 6 0\nEDGE_SE2 8 9 1 0 0" + kIdentity);
  EXPECT_EQ(report.at("doubled").as_int64(), 1);
  EXPECT_EQ(report.at("unconstrained").as_int64(), 1);
  const std::string all = suspicions(report);
  EXPECT_THAT(all, HasSubstr("1 factor on variables that another"));
  EXPECT_THAT(all, HasSubstr("VERTEX_SE2 7"));
  EXPECT_THAT(all, HasSubstr("2 parts that no factor joins"));
}

TEST_F(InfoCommand, SuspectsUnitsWhereChi2IsFarFromTheDegreesOfFreedom) {
  const std::string loop = "EDGE_SE2 0 2 100 0 0" + kIdentity;
  EXPECT_THAT(suspicions(info_of(kChain + loop)), HasSubstr("far from the measurements"));
  EXPECT_THAT(suspicions(info_of(kChain + "EDGE_SE2 0 2 2 0 0" + kIdentity)),
              HasSubstr("too small"));
}

TEST_F(InfoCommand, SkippedLinesAreCountedAndToldOnStandardError) {
  CAIRN_NEEDS("types", "slam2d");
  const std::string text = kChain + "EDGE_UNHEARD_OF 0 1 2 3\n";
  write_text(folder_.file("odd.g2o"), text);
  EXPECT_EQ(cairn({"info", folder_.file("odd.g2o")}).exit_code, 3);
  const Outcome skipping = cairn({"info", folder_.file("odd.g2o"), "--skip-unknown"});
  EXPECT_EQ(skipping.exit_code, 0);
  EXPECT_THAT(skipping.err, HasSubstr("skipped 1 line with unknown tag 'EDGE_UNHEARD_OF'"));
}

TEST_F(InfoCommand, SaysThatTheGaugeOfCamerasIsLeftFree) {
  const Outcome outcome = cairn({"info", "@bundle:cameras=6,points=100"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(unfolded(outcome.out),
              HasSubstr("not known (the gauge of a component is left free: anchoring "
                        "VERTEX_CAMERA_BAL 0 would constrain more, or contradict its priors)"));
}

TEST_F(InfoCommand, TellsTheMetric) {
  const Outcome outcome = cairn({"info", "@sphere", "--types", "slam3d:metric=g2o"});
  EXPECT_THAT(outcome.out, HasSubstr("metric g2o"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("formerly")));
  // The default has a word on what it was; graphs of the plane have no metric.
  const std::string by_default = unfolded(cairn({"info", "@sphere"}).out);
  EXPECT_THAT(by_default, HasSubstr("metric rotation_vector"));
  EXPECT_THAT(by_default, HasSubstr("rotation_vector (default; formerly logarithm: --types "));
  EXPECT_THAT(cairn({"info", "@ring"}).out, Not(HasSubstr("metric")));
}

TEST_F(InfoCommand, SuspectsAPriorOnAPartOfAnOrientationInSpace) {
  const std::string pose = "VERTEX_SE3:QUAT 4 0 0 0 0 0 0 1\n";
  const std::string position = "EDGE_PRIOR_SE3:QUAT 4 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 ";
  // Roll and pitch; all or nothing of the orientation is as good as it looks.
  EXPECT_THAT(suspicions(info_of(pose + position + "9 0 0 9 0 0\n")),
              HasSubstr("1 prior measures a part of an orientation in space (first: "
                        "EDGE_PRIOR_SE3:QUAT 4)"));
  EXPECT_THAT(suspicions(info_of(pose + position + "9 0 0 9 0 9\n")),
              Not(HasSubstr("part of an orientation")));
  EXPECT_THAT(suspicions(info_of(pose + position + "0 0 0 0 0 0\n")),
              Not(HasSubstr("part of an orientation")));
  const std::string orientation = position + "0 0 0 0 0 0\nEDGE_SE3_PRIORQUAT 4 1 0 0 0 ";
  EXPECT_THAT(suspicions(info_of(pose + orientation + "9 0 0 9 0 0\n")),
              HasSubstr("(first: EDGE_SE3_PRIORQUAT 4)"));
  EXPECT_THAT(suspicions(info_of(pose + orientation + "9 0 0 9 0 9\n")),
              Not(HasSubstr("part of an orientation")));
}

// Two unknown poses in a chain: H = JᵀJ with |det J| = 1 (two rigid motions), so that |H| is the
// product of the information.
TEST_F(InfoCommand, TheEntropyOfAChainIsThatOfItsMeasurements) {
  const std::string chain =
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n"
      "EDGE_SE2 0 1 1 0 0 4 0 0 9 0 25\nEDGE_SE2 1 2 1 0 0 100 0 0 400 0 16\n";
  const auto report = info_of(chain, {"--entropy"});
  const double log_determinant = std::log(4.0 * 9.0 * 25.0 * 100.0 * 400.0 * 16.0);
  const auto& entropy = report.at("entropy");
  EXPECT_EQ(entropy.at("size").as_int64(), 6);
  EXPECT_EQ(entropy.at("linear_solver").as_string(), "block_cholesky");
  EXPECT_NEAR(entropy.at("log_determinant").as_double(), log_determinant, 1e-9);
  const double expected =
      0.5 * (6.0 * std::log(2.0 * std::numbers::pi * std::numbers::e) - log_determinant);
  EXPECT_NEAR(entropy.at("nats").as_double(), expected, 1e-9);
  EXPECT_GE(report.at("seconds").at("entropy").as_double(), 0.0);
  const auto other = info_of(chain, {"--entropy", "--linear-solver", "eigen"});
  EXPECT_NEAR(other.at("entropy").at("nats").as_double(), expected, 1e-9);
  EXPECT_FALSE(info_of(chain).as_object().contains("entropy"));
  const Outcome text = cairn({"info", folder_.file("graph.g2o"), "--entropy"});
  EXPECT_THAT(text.out, HasSubstr(" nats (6 unknowns, ln |H| "));
}

TEST_F(InfoCommand, WithoutAnEntropyAllElseIsThere) {
  write_text(folder_.file("loose.g2o"),
             "VERTEX_XY 0 0 0\nVERTEX_SE2 1 1 0 0\nFIX 0\nEDGE_SE2_XY 1 0 -1 0 1 0 1\n");
  const std::string json = folder_.file("report.json");
  const Outcome outcome = cairn({"info", folder_.file("loose.g2o"), "--entropy", "--json", json});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, HasSubstr("no entropy: "));
  EXPECT_THAT(outcome.err, HasSubstr("VERTEX_SE2 1"));
  EXPECT_THAT(outcome.out, HasSubstr("none: H is singular"));
  EXPECT_THAT(outcome.out, HasSubstr("EDGE_SE2_XY"));
  EXPECT_TRUE(parse_json(read_text(json)).at("entropy").is_null());
}

TEST_F(InfoCommand, RefusesASolverWithoutDeterminantsBeforeItReadsTheGraph) {
  CAIRN_NEEDS("linear_solver", "pcg");
  const Outcome outcome = cairn({"info", "nowhere.g2o", "--entropy", "--linear-solver", "pcg"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("linear solver 'pcg' gives no determinants"));
  EXPECT_THAT(outcome.err, HasSubstr("block_cholesky"));
}

}  // namespace
}  // namespace cairn::test
