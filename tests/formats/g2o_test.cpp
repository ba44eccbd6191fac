// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pair;
using ::testing::Pointwise;

constexpr const char* kPlanar =
    "VERTEX_SE2 0 0 0 0\n"
    "VERTEX_SE2 1 1 0.5 0.25\n"
    "EDGE_SE2 0 1 1.5 0.5 0.125 10 1 2 20 3 30\n";

TEST(G2o, ReadsPlanarPosesWithInformationRowByRow) {
  const Reading r = read("g2o", kPlanar);
  EXPECT_EQ(r.report.format, "g2o");
  EXPECT_THAT(r.report.notes, IsEmpty());
  EXPECT_THAT(r.state(1), ElementsAre(1, 0.5, 0.25));
  EXPECT_EQ(r.factor_tag(0), "EDGE_SE2");
  EXPECT_THAT(r.ids(0), ElementsAre(0, 1));
  EXPECT_THAT(r.measurement(0), ElementsAre(1.5, 0.5, 0.125));
  EXPECT_THAT(r.information(0), ElementsAre(10, 1, 2, 20, 3, 30));
}

TEST(G2o, TakesWhateverLayoutPeopleWrite) {
  const Reading r = read("g2o",
                         "\xef\xbb\xbf# a comment\r\n"
                         "\r\n"
                         "   \t \n"
                         "VERTEX_SE2\t0   +0.0  -0 .0  \r\n"
                         "  VERTEX_SE2 1 1. 5e-1 2.5E-1\t\n"
                         "#LOOP edges\n"
                         "EDGE_SE2 0 1 +1.5 0.5e+0 0.125 10 1 2 20 3 3.0E1 # and a comment\n"
                         "FIX 0");
  EXPECT_EQ(difference(r.graph, read("g2o", std::string(kPlanar) + "FIX 0\n").graph),
            "VERTEX_SE2 0");  // the sign of one zero, which is kept
  EXPECT_TRUE(std::signbit(r.state(0)[1]));
  EXPECT_THAT(r.state(1), ElementsAre(1, 0.5, 0.25));
  EXPECT_THAT(r.information(0), ElementsAre(10, 1, 2, 20, 3, 30));
  EXPECT_TRUE(r.graph.fixed(0));
}

TEST(G2o, TakesVerticesInAnyOrderAndAfterTheEdges) {
  const Reading r = read("g2o",
                         "FIX 7 2\n"
                         "EDGE_SE2 7 2 1 0 0 1 0 0 1 0 1\n"
                         "VERTEX_SE2 7 1 0 0\n"
                         "VERTEX_SE2 2 0 0 0\n");
  EXPECT_EQ(r.graph.id(0), 2);
  EXPECT_EQ(r.graph.id(1), 7);
  EXPECT_THAT(r.ids(0), ElementsAre(7, 2)) << "an edge that points backwards stays as it is";
  EXPECT_TRUE(r.graph.fixed(0));
  EXPECT_TRUE(r.graph.fixed(1));
}

TEST(G2o, KeepsDoubledEdges) {
  const std::string edge = "EDGE_SE2 0 1 1.5 0.5 0.125 10 1 2 20 3 30\n";
  EXPECT_EQ(read("g2o", kPlanar + edge + edge).graph.factor_count(), 3);
}

TEST(G2o, ReadsEveryTagThatTypesOffer) {
  const Reading r =
      read("g2o",
           "VERTEX_SE2 0 0 0 0\n"
           "VERTEX_XY 5 2 1\n"
           "VERTEX_SE3:QUAT 10 0 0 0 0 0 0 1\n"
           "VERTEX_TRACKXYZ 11 1 2 3\n"
           "EDGE_SE2_XY 0 5 2 1 4 0 4\n"
           "EDGE_BEARING_RANGE_SE2_XY 0 5 0.4636 2.236 100 0 10\n"
           "EDGE_PRIOR_SE2 0 0 0 0 1 0 0 1 0 1\n"
           "EDGE_PRIOR_XY 5 2 1 1 0 1\n"
           "EDGE_PRIOR_SE3:QUAT 10 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"
           "EDGE_PRIOR_TRACKXYZ 11 1 2 3 1 0 0 1 0 1\n"
           "VERTEX_TRACKXYZ 12 2 2 3\nVERTEX_XY 6 3 1\n"
           "EDGE_POINTXYZ 11 12 1 0 0 1 0 0 1 0 1\n"
           "EDGE_POINTXY 5 6 1 0 1 0 1\n");
  EXPECT_EQ(r.graph.variable_count(), 6);
  EXPECT_EQ(r.graph.factor_count(), 8);
  EXPECT_EQ(r.variable_tag(11), "VERTEX_TRACKXYZ");
  EXPECT_THAT(r.measurement(1), ElementsAre(0.4636, 2.236));
}

TEST(G2o, NormalizesQuaternions) {
  const Reading r = read("g2o", "VERTEX_SE3:QUAT 3 1 2 3 0 0 -3 -4\n");
  EXPECT_THAT(r.state(3),
              Pointwise(DoubleNear(1e-15), std::vector<double>{1, 2, 3, 0, 0, 0.6, 0.8}));
}

TEST(G2o, SkipsUnknownTagsOnlyWhenAskedAndCountsThem) {
  const std::string text =
      std::string(kPlanar) + "VERTEX_CAM 4 1\nEDGE_ODD 0 1\nVERTEX_CAM 5 nan\n";
  EXPECT_THAT(refusal("g2o", text), HasSubstr("file:4: unknown tag 'VERTEX_CAM'"));
  const Reading r = read("g2o", text, {.skip_unknown = true});
  EXPECT_THAT(r.report.skipped, ElementsAre(Pair("EDGE_ODD", 1), Pair("VERTEX_CAM", 2)));
  EXPECT_EQ(r.graph.factor_count(), 1);
}

TEST(G2o, RefusesAnUnknownTagWithTheNearestSpellingElseAllOnOffer) {
  const std::string near = refusal("g2o", "VERTEX_SE2 0 0 0 0\nEDGE_S2 0 1 1 0 0 1 0 0 1 0 1\n");
  EXPECT_THAT(near, HasSubstr("file:2: unknown tag 'EDGE_S2'; did you mean 'EDGE_SE2'? (Read"));
  EXPECT_THAT(refusal("g2o", "VERTEX_SE2 0 0 0 0\nEDGE_BEARING_SE2_XY 0 1 0.5 100\n"),
              HasSubstr("; expected EDGE_BEARING_RANGE_SE2_XY with information 0 of the range"));
  EXPECT_EQ(read("g2o",
                 "VERTEX_SE2 0 0 0 0\nVERTEX_XY 1 1 1\n"
                 "EDGE_BEARING_RANGE_SE2_XY 0 1 0.5 1 100 0 0\n")
                .graph.information_rank(0),
            1);
  EXPECT_THAT(near, Not(HasSubstr("on offer")));
  const std::string far = refusal("g2o", "NOTHING_OF_THIS_KIND 0 1\n");
  EXPECT_THAT(far, HasSubstr("file:1: unknown tag 'NOTHING_OF_THIS_KIND'; on offer: "));
  for (const char* tag : {"VERTEX_SE2", "EDGE_PRIOR_XY", "FIX", "EDGE_SE3_PRIOR"})
    EXPECT_THAT(far, HasSubstr(tag));
  if (Registry().has("types", "slam3d")) {
    EXPECT_THAT(far, HasSubstr("EDGE_SE3:QUAT"));
  }
}

// Sensor offsets ---------------------------------------------------------------------------------

constexpr const char* kPoseAndPoint =
    "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"
    "VERTEX_TRACKXYZ 1 4 5 6\n";

TEST(G2o, LeavesObservationsAloneUnderAnIdentityOffset) {
  const Reading r =
      read("g2o", std::string("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n") + kPoseAndPoint +
                      "EDGE_SE3_TRACKXYZ 0 1 0 0.1 0.2 0.3 1.1 0.1 0.2 2.2 0.3 3.3\n");
  EXPECT_THAT(r.measurement(0), ElementsAre(0.1, 0.2, 0.3));
  EXPECT_THAT(r.information(0), ElementsAre(1.1, 0.1, 0.2, 2.2, 0.3, 3.3));
}

TEST(G2o, TurnsObservationsAndTheirInformationBySensorOffsets) {
  // A quarter turn about z: the sensor's x is the robot's y, its y the robot's −x.
  const Reading r = read("g2o", std::string(kPoseAndPoint) +
                                    "EDGE_SE3_TRACKXYZ 0 1 7 1 2 3 10 1 2 20 3 30\n"
                                    "PARAMS_SE3OFFSET 7 0.5 0.25 -1 0 0 1 1\n");
  EXPECT_THAT(r.measurement(0),
              Pointwise(DoubleNear(1e-14), std::vector<double>{-2 + 0.5, 1 + 0.25, 3 - 1}));
  EXPECT_THAT(r.information(0),
              Pointwise(DoubleNear(1e-13), std::vector<double>{20, -1, -3, 10, 2, 30}));
}

TEST(G2o, RefusesAnObservationWhoseOffsetIsNotThere) {
  EXPECT_EQ(
      refusal("g2o", std::string(kPoseAndPoint) + "EDGE_SE3_TRACKXYZ 0 1 7 1 2 3 10 1 2 20 3 30\n"),
      "file:3: EDGE_SE3_TRACKXYZ refers to parameter 7; expected a line 'PARAMS_SE3OFFSET 7 …' in "
      "this file");
}

constexpr const char* kPriorInformation = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";

TEST(G2o, ReadsAPriorOnlyWhereItsOffsetIsTheIdentity) {
  const std::string prior =
      std::string(kPoseAndPoint) + "EDGE_SE3_PRIOR 0 2 1 0 0 0 0 0 1" + kPriorInformation;
  const Reading r = read("g2o", prior + "PARAMS_SE3OFFSET 2 0 0 0 0 0 0 1\n");
  EXPECT_EQ(r.factor_tag(0), "EDGE_PRIOR_SE3:QUAT");
  EXPECT_THAT(r.measurement(0), ElementsAre(1, 0, 0, 0, 0, 0, 1));
  EXPECT_THAT(
      refusal("g2o", prior + "PARAMS_SE3OFFSET 2 0 0 0.1 0 0 0 1\n"),
      HasSubstr(
          "file:3: EDGE_SE3_PRIOR with the sensor offset of line 4 cannot be expressed exactly; "
          "expected an offset of 0 0 0 0 0 0 1"));
}

// The tags by which programs write positions, orientations and directions of poses.

constexpr const char* kSpatialPose = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n";

TEST(G2o, ReadsAPositionByEveryTagThatMeansOne) {
  const std::string numbers = " 1 2 3 10 1 2 20 3 30\n";
  const std::string offset = "PARAMS_SE3OFFSET 7 0 0 0 0 0 0 1\n";
  for (const std::string& line :
       {"EDGE_SE3_PRIORXYZ 0" + numbers, "EDGE_SE3_XYZ_PRIOR 0 7" + numbers + offset,
        "EDGE_SE3_XYZ_PRIOR 0" + numbers, "EDGE_POINTXYZ_PRIOR 0" + numbers}) {
    for (const std::string& text : {kSpatialPose + line, line + kSpatialPose}) {
      SCOPED_TRACE(text);
      const Reading r = read("g2o", text);
      EXPECT_EQ(r.factor_tag(0), "EDGE_SE3_PRIORXYZ");
      EXPECT_THAT(r.measurement(0), ElementsAre(1, 2, 3));
      EXPECT_THAT(r.information(0), ElementsAre(10, 1, 2, 20, 3, 30));
    }
  }
}

TEST(G2o, ReadsAHorizontalPositionWithoutInformationOnTheHeight) {
  const Reading r = read("g2o", std::string(kSpatialPose) + "EDGE_SE3_PRIORXY 0 1 2 10 1 20\n");
  EXPECT_EQ(r.factor_tag(0), "EDGE_SE3_PRIORXYZ");
  EXPECT_THAT(r.measurement(0), ElementsAre(1, 2, 0));
  EXPECT_THAT(r.information(0), ElementsAre(10, 1, 0, 20, 0, 0));
}

TEST(G2o, ReadsAPriorOnAPointByTheSameTagAsAPosition) {
  const Reading r =
      read("g2o", std::string(kPoseAndPoint) + "EDGE_POINTXYZ_PRIOR 1 1 2 3 10 1 2 20 3 30\n");
  EXPECT_EQ(r.factor_tag(0), "EDGE_PRIOR_TRACKXYZ");
  EXPECT_THAT(r.measurement(0), ElementsAre(1, 2, 3));
}

TEST(G2o, ReadsAPositionInThePlaneByEveryTagThatMeansOne) {
  for (const char* line : {"EDGE_PRIOR_SE2_XY 0 1 2 10 1 20\n", "EDGE_SE2_PRIORXY 0 1 2 10 1 20\n",
                           "EDGE_PRIOR_SE2_XY 0 1 2 10 1 1 20\n"}) {
    const Reading r = read("g2o", std::string("VERTEX_SE2 0 0 0 0\n") + line);
    EXPECT_EQ(r.factor_tag(0), "EDGE_PRIOR_SE2_XY") << line;
    EXPECT_THAT(r.measurement(0), ElementsAre(1, 2)) << line;
    EXPECT_THAT(r.information(0), ElementsAre(10, 1, 20)) << line;
  }
  EXPECT_THAT(refusal("g2o", "VERTEX_SE2 0 0 0 0\nEDGE_PRIOR_SE2_XY 0 1 2 10 1 9 20\n"),
              HasSubstr("file:2: the information is not symmetric (1 and 9)"));
}

TEST(G2o, ReadsAnOrientationWithWFirstAndADirection) {
  const Reading r = read("g2o", std::string(kSpatialPose) +
                                    "EDGE_SE3_PRIORQUAT 0 0.6 0 0.8 0 10 1 2 20 3 30\n"
                                    "EDGE_SE3_PRIORVEC 0 0 0 -9.81 0 -2 0 10 1 2 20 3 30\n");
  EXPECT_THAT(r.measurement(0), ElementsAre(0.6, 0, 0.8, 0));
  EXPECT_THAT(r.measurement(1), ElementsAre(0, 0, -1, 0, -1, 0));
}

TEST(G2o, RefusesAPositionOfASensorBesideTheRobot) {
  EXPECT_THAT(
      refusal("g2o", std::string(kSpatialPose) + "EDGE_SE3_XYZ_PRIOR 0 7 1 2 3 10 1 2 20 3 30\n"
                                                 "PARAMS_SE3OFFSET 7 0 0 1 0 0 0 1\n"),
      HasSubstr("file:2: EDGE_SE3_XYZ_PRIOR with the sensor offset of line 3"));
}

TEST(G2o, WritesPartsOfPosesAsItReadsThem) {
  const std::string text = std::string(kSpatialPose) +
                           "EDGE_SE3_PRIORXYZ 0 1 2 3 10 1 2 20 3 30\n"
                           "EDGE_SE3_PRIORQUAT 0 0.6 0 0.8 0 10 1 2 20 3 30\n"
                           "EDGE_SE3_PRIORVEC 0 0 0 -1 0 -1 0 10 1 2 20 3 30\n";
  EXPECT_EQ(write("g2o", read("g2o", text).graph), text);
}

TEST(G2o, TakesAParameterAgainThatSaysTheSame) {
  const std::string once = std::string(kPoseAndPoint) + "PARAMS_SE3OFFSET 7 0.5 0 0 0 0 0 1\n";
  const std::string seen = "EDGE_SE3_TRACKXYZ 0 1 7 1 2 3 10 1 2 20 3 30\n";
  EXPECT_EQ(difference(read("g2o", once + seen).graph,
                       read("g2o", once + "PARAMS_SE3OFFSET 7 0.50 0 0 0 0 0 1\n" + seen).graph),
            "");
  EXPECT_EQ(
      refusal("g2o", once + seen + "PARAMS_SE3OFFSET 7 0.25 0 0 0 0 0 1\n"),
      "file:5: PARAMS_SE3OFFSET 7: line 3 gives other numbers for this id; expected the same, "
      "or another id");
}

TEST(G2o, SaysWhichParametersItLeavesAside) {
  const Reading r =
      read("g2o", std::string("PARAMS_CAMERACALIB 0 1 2 3\nPARAMS_CAMERACALIB 1\n") + kPlanar);
  EXPECT_THAT(r.report.notes,
              ElementsAre("PARAMS_CAMERACALIB left aside (2 lines): no factor in the file "
                          "refers to such parameters"));
}

// Repair
// -------------------------------------------------------------------------------------------

std::string spatial_edge(const std::string& information) {
  return "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"
         "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 " +
         information + "\n";
}
// (z, rx) = 20 and (z, ry) = 30 against a diagonal of 10: as in the published cubicle.
constexpr const char* kMisplaced = "1000 0 0 0 0 0 1000 0 0 0 0 10 20 30 0 10 0 0 10 0 100";

TEST(G2o, RepairsMisplacedInformationOnlyWhenAsked) {
  EXPECT_THAT(
      refusal("g2o", spatial_edge(kMisplaced)),
      HasSubstr("file:3: the information of EDGE_SE3:QUAT 0 1 is not positive semidefinite"));
  EXPECT_THAT(refusal("g2o", spatial_edge(kMisplaced)),
              HasSubstr("ReadOptions::repair_information"));
  const Reading r = read("g2o", spatial_edge(kMisplaced), {.repair_information = true});
  EXPECT_EQ(r.report.repaired, 1);
  EXPECT_THAT(r.information(0), ElementsAre(1000, 0, 0, 0, 0, 20, 1000, 0, 0, 0, 30, 10, 0, 0, 0,
                                            10, 0, 0, 10, 0, 100));
}

TEST(G2o, RepairsNothingThatIsPositiveDefinite) {
  const Reading r = read("g2o", spatial_edge("9 0 0 0 0 0 9 0 0 0 0 9 1 2 0 9 0 0 9 0 9"),
                         {.repair_information = true});
  EXPECT_EQ(r.report.repaired, 0);
  EXPECT_THAT(r.information(0),
              ElementsAre(9, 0, 0, 0, 0, 0, 9, 0, 0, 0, 0, 9, 1, 2, 0, 9, 0, 0, 9, 0, 9));
}

TEST(G2o, RefusesInformationThatTheRepairDoesNotMend) {
  // Still indefinite once moved; and places to move to that are taken.
  for (const char* information : {"10 0 0 0 0 0 10 0 0 0 0 10 20 30 0 10 0 0 10 0 1",
                                  "1000 0 0 0 0 1 1000 0 0 0 0 10 20 30 0 10 0 0 10 0 100"}) {
    EXPECT_THAT(
        refusal("g2o", spatial_edge(information), {.repair_information = true}),
        HasSubstr("file:3: the information of EDGE_SE3:QUAT 0 1 is not positive semidefinite"));
  }
}

}  // namespace
}  // namespace cairn::test
