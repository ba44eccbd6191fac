// SPDX-License-Identifier: BSD-3-Clause
// Starts at which a residual is large and its gradient zero are left: a maximum is no estimate.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {
namespace {

using testing::HasSubstr;
using testing::Not;

class Stationary : public testing::Test {
 protected:
  /// The end of an optimisation from the states in the file.
  Outcome optimize(const std::string& text, const std::vector<std::string>& options) {
    write_text(folder_.file("graph.g2o"), text);
    std::vector<std::string> arguments{"optimize", folder_.file("graph.g2o"), "--initial",
                                       "as_given"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return cairn(arguments);
  }
  static double final_chi2(const Outcome& outcome) {
    const std::string arrow = " → ";
    const std::size_t at = outcome.out.find(arrow);
    return at == std::string::npos ? -1.0 : std::stod(outcome.out.substr(at + arrow.size()));
  }
  void expect_left(const std::string& text, const std::vector<std::string>& options = {},
                   bool gauss_newton = true) {
    for (const char* optimizer : {"levenberg_marquardt", "gauss_newton", "dogleg", "ceres"}) {
      if (!Registry().has("optimizer", optimizer)) continue;
      if (!gauss_newton && std::string(optimizer) == "gauss_newton") continue;
      SCOPED_TRACE(optimizer);
      std::vector<std::string> all{"--optimizer", optimizer};
      all.insert(all.end(), options.begin(), options.end());
      const Outcome outcome = optimize(text, all);
      EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
      EXPECT_GE(final_chi2(outcome), 0.0) << outcome.out;
      EXPECT_LT(final_chi2(outcome), 1e-8) << outcome.out;
      EXPECT_THAT(outcome.out, HasSubstr("no small motion"));
      EXPECT_THAT(outcome.out, Not(HasSubstr("is wrong")));
    }
  }
  TemporaryFolder folder_;
};

/// A landmark in the pose from which it was seen 3 m away, under 0.5 rad.
std::string seen_from_within(const std::string& bearing, const std::string& range) {
  return "VERTEX_SE2 0 0 0 0\nFIX 0\nVERTEX_SE2 1 2 0 0\nEDGE_SE2 0 1 2 0 0 100 0 0 100 0 400\n"
         "VERTEX_XY 2 2 0\nEDGE_BEARING_RANGE_SE2_XY 1 2 0.5 3 " +
         bearing + " 0 " + range + "\n";
}

/// Poses in a row, whose states and measurements agree.
std::string row(int poses) {
  std::string text;
  for (int k = 0; k < poses; ++k)
    text += "VERTEX_SE3:QUAT " + std::to_string(k) + " " + std::to_string(k) + " 0 0 0 0 0 1\n";
  for (int k = 1; k < poses; ++k) {
    text += "EDGE_SE3:QUAT " + std::to_string(k - 1) + " " + std::to_string(k) +
            " 1 0 0 0 0 0 1 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 400 0 0 400 0 400\n";
  }
  return text;
}

std::string gravity(int pose, const std::string& weight) {
  return "EDGE_SE3_PRIORVEC " + std::to_string(pose) + " 0 0 1 0 0 -1 " + weight + " 0 0 " +
         weight + " 0 " + weight + "\n";
}

constexpr const char* kPosition = "EDGE_SE3_PRIORXYZ ";

TEST_F(Stationary, LandmarkInThePoseThatSawItIsPutWhereItWasSeen) {
  expect_left(seen_from_within("100", "100"));
}

TEST_F(Stationary, LandmarkInThePoseThatMeasuredItsRangeOrBearingIsMoved) {
  expect_left(seen_from_within("0", "100"), {}, false);  // one direction is free
  expect_left(seen_from_within("100", "0"), {}, false);
}

TEST_F(Stationary, LandmarkOfTwoRangesInOneOfThePosesIsMoved) {
  expect_left(seen_from_within("0", "100") + "EDGE_BEARING_RANGE_SE2_XY 0 2 0 4 0 0 100\n");
}

TEST_F(Stationary, GravityMeasuredOppositeToTheStatesTurnsThemOver) {
  for (const char* weight : {"1", "100"}) {
    std::string text = row(5);
    for (int k = 0; k < 5; ++k) text += gravity(k, weight);
    for (const int k : {0, 4}) {
      const std::string id = std::to_string(k);
      text += kPosition + id + " " + id + " 0 0 100 0 0 100 0 100\n";
    }
    expect_left(text);
  }
  expect_left(row(3) + gravity(1, "1"), {}, false);
}

TEST_F(Stationary, HalfATurnIsLeftInEveryMetric) {
  for (const char* metric : {"rotation_vector", "logarithm", "g2o"}) {
    const Outcome outcome =
        optimize("FIX 0\n" + row(1) +
                     "VERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"
                     "EDGE_SE3:QUAT 0 1 1 0 0 0 0 1 0 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 400 0 0 "
                     "400 0 400\n",
                 {"--types", std::string("slam3d:metric=") + metric});
    EXPECT_EQ(outcome.exit_code, 0) << metric << outcome.err;
    EXPECT_LT(final_chi2(outcome), 1e-8) << metric << outcome.out;
  }
}

TEST_F(Stationary, MinimumWithAContradictionIsOneWithoutADoubt) {
  const Outcome outcome =
      optimize(row(3) + gravity(1, "1") +
                   "EDGE_PRIOR_SE3:QUAT 0 0 0 0 0 0 0 1 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 400 0 "
                   "0 400 0 400\n",
               {});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NEAR(final_chi2(outcome), 4.0, 1e-6);
  EXPECT_THAT(outcome.out, Not(HasSubstr("no small motion")));
}

TEST_F(Stationary, LandmarksAreMovedOnline) {
  const std::string lines = seen_from_within("100", "100") + "SOLVE\nFULL\nCHI2\nQUIT\n";
  for (const char* estimator : {"batch", "periodic_batch", "incremental_cholesky", "incremental_qr",
                                "ekf", "eif", "seif"}) {
    if (!Registry().has("estimator", estimator)) continue;
    const Outcome outcome =
        cairn({"online", "--estimator", estimator, "--solve", "explicit"}, {}, lines);
    EXPECT_THAT(outcome.out, Not(HasSubstr("free"))) << estimator;
    EXPECT_THAT(outcome.out, Not(HasSubstr("SINGULAR"))) << estimator << outcome.out;
  }
}

}  // namespace
}  // namespace cairn::test
