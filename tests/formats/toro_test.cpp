// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Toro, ReadsInformationInItsOwnOrder) {
  const Reading r = read("toro",
                         "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\n"
                         "EDGE2 0 1 1 2 3 11 12 22 33 13 23\n"
                         "EDGE2 1 0 1 2 3 11 1 22 33 2 3\n");
  EXPECT_EQ(r.report.format, "toro");
  EXPECT_THAT(r.information(0), ElementsAre(11, 12, 13, 22, 23, 33));
  EXPECT_THAT(r.information(1), ElementsAre(11, 1, 2, 22, 3, 33));
  EXPECT_THAT(r.measurement(0), ElementsAre(1, 2, 3));
  EXPECT_THAT(r.ids(1), ElementsAre(1, 0));
}

TEST(Toro, ReadsOldTagsAndOdometryAsTheSameThings) {
  const std::string numbers = " 0 1 1 2 3 11 1 22 33 2 3\n";
  const Reading r = read("toro", "VERTEX 0 0 0 0\nVERTEX2 1 1 0 0\nEDGE" + numbers + "EDGE2" +
                                     numbers + "ODOMETRY" + numbers);
  ASSERT_EQ(r.graph.factor_count(), 3);
  for (int f = 0; f < 3; ++f) {
    EXPECT_EQ(r.factor_tag(f), "EDGE_SE2");
    EXPECT_THAT(r.information(f), ElementsAre(11, 1, 2, 22, 3, 33));
  }
}

// The flavour of SLAM++'s toolbox: landmarks come first in LANDMARK lines, before their vertices.
constexpr const char* kSlamPlusPlus =
    "VERTEX2      0 0.000000 0.000000 0.000000\n"
    "ODOMETRY      1       0 -1.0 0.0 0.0 100 0 500 500 0 0\n"
    "VERTEX2      1 1.0 0.0 0.0\n"
    "LANDMARK      2       1 5.0 -0.5 0.0 100 7 1000 0 0 99999\n"
    "VERTEX2      2 5.4 -2.4 0.0\n";

TEST(Toro, TurnsVerticesOfLandmarksIntoPoints) {
  const Reading r = read("toro", kSlamPlusPlus);
  EXPECT_EQ(r.variable_tag(1), "VERTEX_SE2");
  EXPECT_EQ(r.variable_tag(2), "VERTEX_XY");
  EXPECT_THAT(r.state(2), ElementsAre(5.4, -2.4));
  EXPECT_THAT(r.report.notes, IsEmpty());
}

TEST(Toro, ReadsRangeAndBearingOfLandmarks) {
  const Reading r = read("toro", kSlamPlusPlus);
  EXPECT_EQ(r.factor_tag(1), "EDGE_BEARING_RANGE_SE2_XY");
  EXPECT_THAT(r.ids(1), ElementsAre(1, 2)) << "pose first";
  EXPECT_THAT(r.measurement(1), ElementsAre(-0.5, 5.0)) << "bearing, then range";
  EXPECT_THAT(r.information(1), ElementsAre(1000, 7, 100)) << "rows change places with them";
}

TEST(Toro, SaysWhenALandmarkLosesAnAngle) {
  std::string text = kSlamPlusPlus;
  text.replace(text.rfind("0.0\n"), 3, "0.1");
  EXPECT_THAT(read("toro", text).report.notes,
              ElementsAre("1 landmarks have a vertex with an angle, which a point does not keep"));
}

TEST(Toro, RefusesALandmarkThatIsAlsoAPose) {
  EXPECT_EQ(
      refusal("toro", std::string(kSlamPlusPlus) + "EDGE2 2 1 1 0 0 1 0 1 1 0 0\n"),
      "file:6: EDGE2 uses 2 as a pose, but it is a landmark by line 4; expected ids of poses");
  EXPECT_THAT(refusal("toro", std::string(kSlamPlusPlus) + "LANDMARK 1 2 1 0 0 1 0 1 0 0 9\n"),
              HasSubstr("file:2: ODOMETRY uses 1 as a pose, but it is a landmark by line 6"));
}

TEST(Toro, RefusesALandmarkWhoseThirdRowIsNoDummy) {
  for (const char* bad : {"LANDMARK 2 1 5 -0.5 0.1 100 0 1000 0 0 99999\n",
                          "LANDMARK 2 1 5 -0.5 0 100 0 1000 0 1 99999\n"}) {
    EXPECT_THAT(refusal("toro", std::string(kSlamPlusPlus) + bad),
                HasSubstr("file:6: LANDMARK with a third row that is more than a dummy"));
  }
  // The dummy's place differs between writers.
  EXPECT_EQ(
      refusal("toro", std::string(kSlamPlusPlus) + "LANDMARK 2 1 5 -0.5 0 100 0 1000 99999 0 0\n"),
      "");
}

TEST(Toro, RefusesANegativeRange) {
  EXPECT_THAT(
      refusal("toro", std::string(kSlamPlusPlus) + "LANDMARK 2 1 -5 -0.5 0 100 0 1000 0 0 9\n"),
      HasSubstr("file:6: LANDMARK with range -5; expected a distance of 0 or more"));
}

TEST(Toro, HintsAtTheOtherOrdersOfInformation) {
  const std::string edge = "EDGE2 0 1 1 0 0 50 0 0 50 0 100\n";
  EXPECT_THAT(
      refusal("toro", edge),
      HasSubstr("; the numbers would fit iSAM's square root of the information (format isam)"));
  // Format isam would refuse the vertices.
  EXPECT_THAT(refusal("toro", "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\n" + edge),
              HasSubstr("; the numbers would fit g2o's order of information, I11 I12 I13 I22 I23 "
                        "I33, whose tag is EDGE_SE2"));
}

}  // namespace
}  // namespace cairn::test
