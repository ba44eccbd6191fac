// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::Contains;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pointwise;

TEST(Isam, SquaresTheRootOfTheInformation) {
  // U = [1 2 3; 0 4 5; 0 0 6]: UᵀU = [1 2 3; 2 20 26; 3 26 70].
  for (const char* tag : {"ODOMETRY", "EDGE2"}) {
    const Reading r = read("isam", std::string(tag) + " 0 1 1 2 3 1 2 3 4 5 6\n");
    EXPECT_THAT(r.information(0), ElementsAre(1, 2, 3, 20, 26, 70));
    EXPECT_THAT(r.measurement(0), ElementsAre(1, 2, 3));
    EXPECT_EQ(r.factor_tag(0), "EDGE_SE2");
  }
}

TEST(Isam, TakesOdometryTagsForLoopsToo) {
  const Reading r = read("isam",
                         "ODOMETRY 0 1 1 0 0 1 0 0 1 0 1\nODOMETRY 1 2 1 0 0 1 0 0 1 0 1\n"
                         "ODOMETRY 2 0 -2 0 0 1 0 0 1 0 1\n");
  EXPECT_THAT(r.ids(2), ElementsAre(2, 0));
  EXPECT_TRUE(loop_closures(r.graph)[2]);
}

TEST(Isam, ReadsRollPitchYaw) {
  const double roll = 0.3, pitch = -0.4, yaw = 2.5;
  const Reading r = read("isam",
                         "EDGE3 0 1 1 2 3 0.3 -0.4 2.5 "
                         "2 0 0 0 0 1 3 0 0 0 0 4 0 0 0 5 0 0 6 0 7\n");
  const Eigen::Quaterniond expected = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
  EXPECT_THAT(
      r.measurement(0),
      Pointwise(DoubleNear(1e-15), std::vector<double>{1.0, 2.0, 3.0, expected.x(), expected.y(),
                                                       expected.z(), expected.w()}));
  EXPECT_THAT(r.information(0),
              ElementsAre(4, 0, 0, 0, 0, 2, 9, 0, 0, 0, 0, 16, 0, 0, 0, 25, 0, 0, 36, 0, 50));
}

constexpr const char* kChain =
    "EDGE2 0 1 1 0 0 1 0 0 1 0 1\n"
    "EDGE2 1 2 1 0 0 1 0 0 1 0 1\n";

TEST(Isam, MovesLandmarksThatCollideWithPosesAboveThem) {
  const Reading r =
      read("isam", std::string(kChain) + "LANDMARK 1 1 2 3 10 0 20\nLANDMARK 2 40 2 3 10 0 20\n");
  EXPECT_EQ(r.graph.variable_count(), 5);
  EXPECT_THAT(r.ids(2), ElementsAre(1, 4)) << "landmark 1 after the last pose, 2";
  EXPECT_THAT(r.ids(3), ElementsAre(2, 43));
  EXPECT_EQ(r.variable_tag(4), "VERTEX_XY");
  EXPECT_THAT(r.state(4), ElementsAre(3, 3));
  EXPECT_THAT(r.information(2), ElementsAre(100, 0, 400));
  EXPECT_THAT(
      r.report.notes,
      Contains(HasSubstr("1 landmark ids are also ids of poses: landmark 1 became variable 4")));
}

TEST(Isam, KeepsLandmarksThatShareTheIdsOfPoses) {
  const Reading r = read("isam",
                         "ODOMETRY 0 1 1 0 0 1 0 0 1 0 1\nLANDMARK 1 2 0 5 10 0 10\n"
                         "ODOMETRY 1 3 1 0 0 1 0 0 1 0 1\nLANDMARK 3 2 -1 5 10 0 10\n");
  EXPECT_EQ(r.graph.variable_count(), 4);
  EXPECT_EQ(r.variable_tag(2), "VERTEX_XY");
  EXPECT_THAT(r.state(2), ElementsAre(1, 5));
  EXPECT_THAT(r.report.notes, Not(Contains(HasSubstr("landmark"))));
}

TEST(Isam, RefusesVerticesAndSaysWhatToDo) {
  EXPECT_EQ(
      refusal("isam", std::string(kChain) + "VERTEX2 0 0 0 0\n"),
      "file:3: 'VERTEX2', but iSAM text has no vertices; expected edges only (format toro reads "
      "such vertices)");
}

TEST(Isam, RefusesARootThatIsSingular) {
  EXPECT_EQ(
      refusal("isam", std::string(kChain) + "EDGE2 2 3 1 0 0 44 0 44 31 0 0\n"),
      "file:3: the square root of the information of EDGE2 2 3 has a zero on its diagonal (row 3); "
      "the numbers would fit TORO's order of information (format toro)");
}

TEST(Isam, RefusesAnIdThatIsPlanarAndSpatial) {
  EXPECT_EQ(
      refusal("isam", std::string(kChain) +
                          "EDGE3 2 3 1 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"),
      "file:3: EDGE3 2 3: 2 is a VERTEX_SE2 by line 2; expected a VERTEX_SE3:QUAT");
}

}  // namespace
}  // namespace cairn::test
