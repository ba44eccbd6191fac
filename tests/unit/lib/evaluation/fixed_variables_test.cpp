// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/fixed_variables.hpp"

#include <array>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/cairn.hpp"
#include "cairn/evaluation/graph_survey.hpp"
#include "cairn/evaluation/plausibility.hpp"
#include "support/components.hpp"
#include "support/planar_graph.hpp"

namespace cairn {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// Two chains of three poses, 0 to 2 and 100 to 102, each along x from where it begins.
class FixedPosesTest : public ::testing::Test {
 protected:
  FixedPosesTest() {
    for (const Id first : {0, 100}) {
      for (Id k = 0; k < 3; ++k)
        graph_.add_variable(types_.pose, first + k, std::array{double(k), 0.0, 0.0});
      for (Id k = 0; k < 2; ++k) between(first + k, first + k + 1, {1.0, 0.0, 0.0});
    }
  }
  void between(Id a, Id b, std::array<double, 3> z, double information = 100.0) {
    const std::vector<double> omega = {information, 0, 0, information, 0, 4 * information};
    graph_.add_factor(types_.relative_pose, std::array{index(a), index(b)}, z, omega);
  }
  int index(Id id) const { return *graph_.find(id); }

  test::PlanarTypes types_;
  Graph graph_;
};

TEST_F(FixedPosesTest, TwoMapsWithTheirOwnOriginsContradictEachOther) {
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(100));
  EXPECT_EQ(contradicting_fixed_poses(graph_), "") << "two components, each in its own frame";
  between(2, 100, {1.0, 5.0, 0.0});
  between(101, 1, {0.0, -5.0, 0.0}, 1e-6);  // which hardly says anything
  EXPECT_EQ(
      contradicting_fixed_poses(graph_),
      "VERTEX_SE2 0 and VERTEX_SE2 100 are both fixed, and contradict each other: from one to "
      "the other 3 measurements lead 5.83 m and 0° away from where it is fixed. Fix one of "
      "them only, or bring both into one frame");
  EXPECT_THAT(survey_graph(graph_).suspicions,
              Contains(StartsWith("VERTEX_SE2 0 and VERTEX_SE2 100 are both fixed")));
  EXPECT_THAT(implausible_estimate(graph_, 1e6), HasSubstr("are both fixed, and contradict"));
}

TEST_F(FixedPosesTest, ThoseThatFitTheMeasurementsAreFine) {
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(2));
  EXPECT_EQ(contradicting_fixed_poses(graph_), "");
  graph_.set_state(index(2), std::array{2.3, -0.2, 0.05});  // within two standard deviations
  EXPECT_EQ(contradicting_fixed_poses(graph_), "");
  graph_.set_state(index(2), std::array{4.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_poses(graph_), StartsWith("VERTEX_SE2 0 and VERTEX_SE2 2"));
}

TEST_F(FixedPosesTest, AWrongMeasurementIsNamedWhereAnotherPathAgrees) {
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(2));
  between(0, 2, {7.0, 3.0, 1.0});
  EXPECT_EQ(contradicting_fixed_poses(graph_),
            "VERTEX_SE2 0 and VERTEX_SE2 2 are both fixed: from one to the other 1 measurement "
            "leads 5.83 m and 57.3° away from where it is fixed, though other measurements agree "
            "with both. EDGE_SE2 0 2 is wrong; a robust loss such as cauchy limits it");
}

TEST_F(FixedPosesTest, AWrongMeasurementWithinAPathIsNamed) {
  for (Id k = 2; k < 4; ++k) {
    graph_.add_variable(types_.pose, k + 1, std::array{double(k + 1), 0.0, 0.0});
    between(k, k + 1, {1.0, 0.0, 0.0});
  }
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(4));
  between(1, 3, {9.0, 3.0, 1.0});
  EXPECT_THAT(contradicting_fixed_poses(graph_), HasSubstr("EDGE_SE2 1 3 is wrong"));
  between(0, 4, {4.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_poses(graph_), HasSubstr("EDGE_SE2 1 3 is wrong"));
}

TEST_F(FixedPosesTest, OfSeveralThatMayBeWrongOneIsNamed) {
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(2));
  graph_.set_measurement(1, std::array{1.0, 5.0, 0.0}, {});
  between(0, 2, {2.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_poses(graph_),
              HasSubstr("EDGE_SE2 0 1 or another of 2 is wrong"));
}

TEST(FixedPoses, PosesPlacedByPriorsAreComparedToo) {
  CAIRN_NEEDS("types", "slam2d");
  Graph graph;
  const auto certain = Information::sigmas(0.1, 0.1, 0.05);
  for (int k = 0; k < 5; ++k) graph.add(k, Pose2(k, 0.0, 0.0));
  for (int k = 0; k < 4; ++k) graph.add(Between(k, k + 1, Pose2(1.0, 0.0, 0.0)), certain);
  graph.set_fixed(0);
  EXPECT_EQ(contradicting_fixed_poses(graph), "");
  graph.add(Prior(4, Pose2(9.0, 4.0, 0.0)), Information::sigmas(9.0, 9.0, 9.0));
  EXPECT_EQ(contradicting_fixed_poses(graph), "") << "which hardly says anything";
  graph.add(Prior(2, Pose2(2.0, 8.2, 0.0)), certain);
  EXPECT_EQ(contradicting_fixed_poses(graph),
            "VERTEX_SE2 0 and VERTEX_SE2 2 are placed by FIX and EDGE_PRIOR_SE2 2, and contradict "
            "each other: from one to the other 2 measurements lead 8.2 m and 0° away from where it "
            "is placed. Place one of them only, or bring both into one frame");
  graph.add(Prior(3, Pose2(3.0, 0.0, 0.0)), certain);
  EXPECT_THAT(contradicting_fixed_poses(graph),
              HasSubstr("VERTEX_SE2 2 and VERTEX_SE2 3 are placed by EDGE_PRIOR_SE2 2 and "
                        "EDGE_PRIOR_SE2 3"));
}

TEST_F(FixedPosesTest, TheWorstOfManyIsNamed) {
  for (const Id id : {0, 2, 100, 102}) graph_.set_fixed(index(id));
  graph_.set_state(index(2), std::array{5.0, 0.0, 0.0});
  graph_.set_state(index(102), std::array{9.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_poses(graph_), StartsWith("VERTEX_SE2 100 and VERTEX_SE2 102"));
}

TEST_F(FixedPosesTest, AreComparedAgainstTheDirectionOfAFactorToo) {
  between(100, 2, {-1.0, 0.0, 0.0});
  graph_.set_fixed(index(0));
  graph_.set_fixed(index(100));
  graph_.set_state(index(100), std::array{3.0, 0.0, 0.0});
  EXPECT_EQ(contradicting_fixed_poses(graph_), "");
  graph_.set_state(index(100), std::array{1.0, 0.0, 0.0});
  EXPECT_THAT(contradicting_fixed_poses(graph_), HasSubstr("lead 2 m"));
}

}  // namespace
}  // namespace cairn
