// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/fixed_variables.hpp"

#include <array>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/evaluation/graph_survey.hpp"
#include "cairn/evaluation/plausibility.hpp"
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
