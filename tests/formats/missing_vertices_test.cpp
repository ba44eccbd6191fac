// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::Pointwise;

constexpr const char* kI = " 1 0 0 1 0 1\n";

TEST(MissingVertices, AreMadeAlongTheFactorsAndCounted) {
  const Reading r = read(
      "g2o", std::string("EDGE_SE2 0 1 1 0 1.5707963267948966") + kI + "EDGE_SE2 1 2 2 0 0" + kI);
  EXPECT_THAT(r.state(0), ElementsAre(0, 0, 0));
  EXPECT_THAT(r.state(2),
              Pointwise(DoubleNear(1e-15), std::vector<double>{1, 2, std::numbers::pi / 2}));
  EXPECT_THAT(r.report.notes,
              ElementsAre("the file has no vertices: 3 were made, with states propagated along "
                          "the factors"));
}

TEST(MissingVertices, ComeFromTheOdometryNotFromLoops) {
  // 0 → 2 is a loop that lies; it stands first in the file.
  const Reading r = read("g2o", std::string("EDGE_SE2 0 2 9 9 0") + kI + "EDGE_SE2 0 1 1 0 0" + kI +
                                    "EDGE_SE2 1 2 1 0 0" + kI);
  EXPECT_THAT(r.state(2), ElementsAre(2, 0, 0));
}

TEST(MissingVertices, AreReachedAgainstTheDirectionOfAnEdge) {
  const Reading r =
      read("g2o", std::string("EDGE_SE2 1 0 -1 0 0") + kI + "EDGE_SE2 2 1 -1 0 0" + kI);
  EXPECT_THAT(r.state(2), Pointwise(DoubleNear(1e-15), std::vector<double>{2, 0, 0}));
}

TEST(MissingVertices, StartAgainWhereNothingConnects) {
  const Reading r = read("g2o", std::string("EDGE_SE2 5 6 1 0 0") + kI + "EDGE_SE2 8 9 2 0 0" + kI);
  EXPECT_THAT(r.state(5), ElementsAre(0, 0, 0));
  EXPECT_THAT(r.state(8), ElementsAre(0, 0, 0));
  EXPECT_THAT(r.state(9), ElementsAre(2, 0, 0));
  EXPECT_THAT(
      r.report.notes,
      ElementsAre(
          "the file has no vertices: 4 were made, with states propagated along the factors from 2 "
          "starting points that no factor connects"));
}

TEST(MissingVertices, StandAtTheirPriors) {
  const Reading r =
      read("g2o", std::string("EDGE_SE2 0 1 1 0 0") + kI + "EDGE_PRIOR_SE2 1 5 5 0" + kI);
  EXPECT_THAT(r.state(1), ElementsAre(5, 5, 0));
  EXPECT_THAT(r.state(0), ElementsAre(4, 5, 0));
}

// What is not measured is beside the pose before, whatever number stands there.
TEST(MissingVertices, TakeNothingFromComponentsWithoutInformation) {
  const Reading r =
      read("g2o", std::string("EDGE_SE2 0 1 77 0.5 0 0 0 0 1 0 1\n") + "EDGE_SE2 1 2 1 0 0" + kI);
  EXPECT_THAT(r.state(1), Pointwise(DoubleNear(1e-12), std::vector<double>{0, 0.5, 0}));
  EXPECT_THAT(r.state(2), Pointwise(DoubleNear(1e-12), std::vector<double>{1, 0.5, 0}));
  EXPECT_THAT(r.report.notes, ElementsAre("the file has no vertices: 3 were made, with states "
                                          "propagated along the factors"));
}

TEST(MissingVertices, GoAroundAnEdgeWithoutInformationOnTheHeading) {
  const Reading r = read("g2o", std::string("EDGE_SE2 0 1 1 0 3 1 0 0 1 0 0\n") +
                                    "EDGE_SE2 0 2 1 1 0" + kI + "EDGE_SE2 2 1 0 -1 0.5" + kI);
  EXPECT_THAT(r.state(1), Pointwise(DoubleNear(1e-12), std::vector<double>{1, 0, 0.5}));
}

TEST(MissingVertices, StandAtTheirPositionWhereThatIsAllThatIsKnown) {
  const std::string edge = std::string("EDGE_SE2 0 1 1 0 0") + kI;
  for (const char* prior :
       {"EDGE_PRIOR_SE2 0 500000 5 2 1 0 0 1 0 0\n", "EDGE_PRIOR_SE2_XY 0 500000 5 1 0 1\n"}) {
    const Reading r = read("g2o", edge + prior);
    EXPECT_THAT(r.state(0), Pointwise(DoubleNear(1e-9), std::vector<double>{500000, 5, 0}))
        << prior;
    EXPECT_THAT(r.state(1), Pointwise(DoubleNear(1e-9), std::vector<double>{500001, 5, 0}))
        << prior;
  }
}

TEST(MissingVertices, SeesLandmarksFromTheFirstPoseInTheFile) {
  const Reading r = read("g2o", std::string("EDGE_SE2 0 1 1 0 0") + kI +
                                    "EDGE_SE2_XY 0 9 3 4 1 0 1\nEDGE_SE2_XY 1 9 7 7 1 0 1\n");
  EXPECT_THAT(r.state(9), ElementsAre(3, 4));
}

TEST(MissingVertices, AreAnErrorWhereTheFileHasOthers) {
  EXPECT_EQ(refusal("g2o", std::string("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 1 1 0 0") + kI),
            "file:2: EDGE_SE2 0 1: there is no vertex 1 in this file; expected a line that gives "
            "it, or a file without any vertices (ReadOptions::skip_dangling leaves out what leads "
            "to vertices of another file)");
}

TEST(MissingVertices, CanBeHeld) {
  const Reading r = read("g2o", std::string("EDGE_SE2 0 1 1 0 0") + kI + "FIX 1\n");
  EXPECT_TRUE(r.graph.fixed(1));
}

}  // namespace
}  // namespace cairn::test
