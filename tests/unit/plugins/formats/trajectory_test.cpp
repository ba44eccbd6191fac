// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "unit/plugins/formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pointwise;

TEST(Trajectory, TumStampsThatAreWholeNumbersAreIds) {
  const Reading r =
      read("tum", "# stamp x y z qx qy qz qw\n3 1 2 3 0 0 0 1\n17.0 4 5 6 0 0 0.6 0.8\n");
  EXPECT_THAT(r.state(3), ElementsAre(1, 2, 3, 0, 0, 0, 1));
  EXPECT_THAT(r.state(17), ElementsAre(4, 5, 6, 0, 0, 0.6, 0.8));
  EXPECT_EQ(r.graph.factor_count(), 0);
  EXPECT_THAT(r.report.notes, IsEmpty());
}

TEST(Trajectory, OtherTumStampsGiveRowNumbersAsIds) {
  const Reading r = read("tum", "3.5 1 2 3 0 0 0 1\n4 4 5 6 0 0 0 1\n");
  EXPECT_EQ(r.graph.id(0), 0);
  EXPECT_EQ(r.graph.id(1), 1);
  EXPECT_THAT(r.report.notes,
              ElementsAre("the stamps are not integers: ids are the row numbers from 0"));
}

TEST(Trajectory, TumStampsAreReportedByRisingId) {
  EXPECT_THAT(read("tum", "3.5 1 2 3 0 0 0 1\n4 4 5 6 0 0 0 1\n").report.stamps,
              ElementsAre(3.5, 4));
  EXPECT_THAT(read("tum", "17 1 2 3 0 0 0 1\n4 4 5 6 0 0 0 1\n").report.stamps, ElementsAre(4, 17));
  EXPECT_THAT(read("kitti", "1 0 0 0 0 1 0 0 0 0 1 0\n").report.stamps, IsEmpty());
}

TEST(Trajectory, TumStampsMustRiseWhereRowsAreIds) {
  EXPECT_EQ(refusal("tum", "3.5 1 2 3 0 0 0 1\n3.25 4 5 6 0 0 0 1\n"),
            "file:2: stamp 3.25 after 3.5; expected rising stamps");
  EXPECT_EQ(
      refusal("tum", "3 1 2 3 0 0 0 1\n3 4 5 6 0 0 0 1\n"),
      "file:2: VERTEX_SE3:QUAT 3: the id was already given in line 1; expected every id once");
}

TEST(Trajectory, KittiRowsAreRotationAndPosition) {
  const Reading r = read("kitti", "1 0 0 0 0 1 0 0 0 0 1 0\n0 -1 0 7 1 0 0 8 0 0 1 9\n");
  const double half = std::numbers::sqrt2 / 2;
  EXPECT_THAT(r.state(1), Pointwise(DoubleNear(1e-15),
                                    std::vector<double>{7.0, 8.0, 9.0, 0.0, 0.0, half, half}));
}

TEST(Trajectory, KittiRowsMustBeRotations) {
  for (const char* bad :
       {"1 0 0 0 0 1 0 0 0 0 -1 0", "2 0 0 0 0 1 0 0 0 0 1 0", "0 0 0 0 0 0 0 0 0 0 0 0"}) {
    EXPECT_EQ(refusal("kitti", std::string("1 0 0 0 0 1 0 0 0 0 1 0\n") + bad + "\n"),
              "file:2: the first three columns of the KITTI row are not a rotation; expected an "
              "orthonormal 3x3 "
              "matrix of determinant 1");
  }
}

TEST(Trajectory, TablesHaveAnIdOrGoByRow) {
  EXPECT_THAT(read("table", "7 1 2 0.5\n").state(7), ElementsAre(1, 2, 0.5));
  EXPECT_THAT(read("table", "1 2 0.5\n3 4 0.25\n").state(1), ElementsAre(3, 4, 0.25));
  EXPECT_EQ(refusal("table", "1 2 0.5\n3 4 5 0.25\n"),
            "file:2: a row x y theta with 4 fields; expected 3 fields (3 numbers)");
}

TEST(Trajectory, ComparesWithItselfWithoutError) {
  const Reading planar = read("table", "0 0 0\n1 0 0.1\n2 0.5 0.2\n3 1 3\n");
  for (const char* format : {"tum", "kitti"}) {
    const Reading spatial = read(format, write(format, planar.graph));
    const TrajectoryError error = compare(trajectory(spatial.graph), trajectory(planar.graph));
    EXPECT_EQ(error.poses, 4);
    EXPECT_LT(error.ate_translation, 1e-12);
    EXPECT_LT(error.ate_rotation, 1e-5);  // [deg]; an arc cosine near 1
  }
}

TEST(Trajectory, WritesPosesByIdAndLeavesOutLandmarks) {
  const Reading r =
      read("g2o",
           "VERTEX_SE2 4 1 2 0\nVERTEX_XY 3 9 9\nVERTEX_SE2 2 0.5 0 3.141592653589793\n"
           "EDGE_SE2_XY 4 3 1 1 1 0 1\n");
  const std::string text = write("tum", r.graph);
  const Reading back = read("tum", text);
  EXPECT_EQ(back.graph.variable_count(), 2);
  EXPECT_THAT(back.state(4), ElementsAre(1, 2, 0, 0, 0, 0, 1));
  EXPECT_THAT(back.state(2),
              Pointwise(DoubleNear(1e-15), std::vector<double>{0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0}));
}

TEST(Trajectory, KittiRefusesIdsThatItsRowsCannotSay) {
  const Reading r = read("table", "0 0 0 0\n2 1 0 0\n");
  EXPECT_EQ(write_refusal("kitti", r.graph),
            "format kitti cannot express VERTEX_SE2 2 in row 1; expected poses 0, 1, 2 … without a "
            "gap, since the row "
            "is the id (format tum keeps ids)");
}

TEST(Trajectory, RefusesToWriteNoPoses) {
  EXPECT_THAT(write_refusal("tum", read("g2o", "VERTEX_XY 1 0 0\n").graph),
              HasSubstr("format tum cannot express a graph without a pose"));
  EXPECT_THAT(write_refusal("kitti", Graph()), HasSubstr("the graph is empty"));
}

}  // namespace
}  // namespace cairn::test
