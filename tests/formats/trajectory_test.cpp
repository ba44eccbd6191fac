// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/evaluation/trajectory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <numbers>
#include <string>

#include "cairn/typed/symbol.hpp"
#include "cairn/types/define_variable.hpp"

#include "formats/reading.hpp"
#include "support/placeless.hpp"

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
}

TEST(Trajectory, OfTumRowsWithOneStampTheFirstIsKept) {
  const Reading times =
      read("tum", "0.5 1 2 3 0 0 0 1\n0.75 4 5 6 0 0 0 1\n0.75 4 5 6 0 0 0 1\n1 7 8 9 0 0 0 1\n");
  EXPECT_EQ(times.graph.variable_count(), 3);
  EXPECT_THAT(times.state(2), ElementsAre(7, 8, 9, 0, 0, 0, 1));
  EXPECT_THAT(times.report.stamps, ElementsAre(0.5, 0.75, 1));
  EXPECT_THAT(times.report.notes[0],
              "1 row has the stamp of an earlier row, the first in line 3: of rows with one stamp "
              "the first is kept");
  const Reading ids = read("tum", "3 1 2 3 0 0 0 1\n7 9 9 9 0 0 0 1\n3 4 5 6 0 0 0 1\n");
  EXPECT_THAT(ids.state(3), ElementsAre(1, 2, 3, 0, 0, 0, 1));
  EXPECT_THAT(ids.report.stamps, ElementsAre(3, 7));
  EXPECT_THAT(ids.report.notes,
              ElementsAre(HasSubstr("in line 3: of rows with one stamp the first is kept, though 1 "
                                    "of the others has another pose")));
  EXPECT_THAT(refusal("tum", "0 1 2 3 0 0 0 1\n0 4 5 6 0 0 0 1\n0 7 8 9 0 0 0 1\n"),
              HasSubstr("file:2: stamp 0 as in every other row"));
}

TEST(Trajectory, TumStampsInNanosecondsAreSecondsToTheLastBit) {
  const char* rows[] = {
      "1403715524907143168 1 2 3 0 0 0 1\n1403715525107143168 4 5 6 0 0 0 1\n",
      "1.403715524907143168e18 1 2 3 0 0 0 1\n1.403715525107143168E+18 4 5 6 0 0 0 1\n",
      "+1403715524907143168 1 2 3 0 0 0 1\n1403715525107143168.0 4 5 6 0 0 0 1\n"};
  for (const char* text : rows) {
    const Reading r = read("tum", text);
    EXPECT_THAT(r.report.stamps, ElementsAre(1403715524.907143168, 1403715525.107143168)) << text;
    EXPECT_THAT(r.report.notes,
                ElementsAre("the stamps are nanoseconds, read as seconds; ids are the row numbers "
                            "from 0"));
    EXPECT_TRUE(r.report.row_ids);
  }
}

TEST(Trajectory, TumMayHaveCommasAndNamesOfItsColumns) {
  for (const char* names : {"", "timestamp,tx,ty,tz,qx,qy,qz,qw\n", "# t,x,y,z,qx,qy,qz,qw\n"}) {
    const std::string text =
        std::string(names) + "1.4e9,1,2,3,0,0,0.6,0.8\n1400000000.5, 4, 5, 6, 0, 0, 0, 1\n";
    EXPECT_EQ(detected(text), "tum") << names;
    const Reading r = read("tum", text);
    EXPECT_THAT(r.state(0), ElementsAre(1, 2, 3, 0, 0, 0.6, 0.8));
    EXPECT_THAT(r.report.stamps, ElementsAre(1.4e9, 1400000000.5));
  }
  EXPECT_EQ(refusal("tum", "time,x,y,z,qx,qy,qz,qw\n1.5,1,2,3,0,0,1\n"),
            "file:2: a TUM row with 7 fields; expected 8 fields (8 numbers)");
  EXPECT_THAT(
      refusal("tum", "#time,x,y,z,qw,qx,qy,qz\n1.5,1,2,3,1,0,0,0\n"),
      HasSubstr("w of the quaternion in column 5; expected column 8 (format tum has it in column "
                "8, euroc in column 5)"));
}

// EuRoC -------------------------------------------------------------------------------------------

constexpr const char* kEurocNames =
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z "
    "[], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], "
    "b_w_RS_S_y "
    "[rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m "
    "s^-2]\n";
constexpr const char* kEurocRows =
    "1403636580838555648,4.688319,-1.786938,0.783338,0.8,0.6,0,0,-0.027876,0.033207,0.800006,-"
    "0.003172,0.021267,0.078502,-0.025266,0.136696,0.075593\n"
    "1403636580843555328,4.688177,-1.78677,0.78735,0.6,0,0.8,0,-0.029272,0.033992,0.804771,-"
    "0.003172,0.021267,0.078502,-0.025266,0.136696,0.075593\r\n";

TEST(Trajectory, EurocHasNanosecondsAndWFirst) {
  for (const std::string& names : {std::string(kEurocNames), std::string()}) {
    const std::string text = names + kEurocRows;
    EXPECT_EQ(detected(text), "euroc");
    const Reading r = read("euroc", text);
    EXPECT_THAT(r.state(0), ElementsAre(4.688319, -1.786938, 0.783338, 0.6, 0, 0, 0.8));
    EXPECT_THAT(r.state(1), ElementsAre(4.688177, -1.78677, 0.78735, 0, 0.8, 0, 0.6));
    EXPECT_THAT(r.report.stamps, ElementsAre(1403636580.838555648, 1403636580.843555328));
    EXPECT_TRUE(r.report.row_ids);
    EXPECT_THAT(r.report.notes, ::testing::Contains("the last 9 columns, such as velocities and "
                                                    "biases, are left out"));
    EXPECT_EQ(r.report.notes.size(), names.empty() ? 3U : 2U);  // that w is taken to be first
  }
}

TEST(Trajectory, EurocMayEndWithTheQuaternion) {
  const std::string names =
      "#timestamp [ns], p_x [m], p_y [m], p_z [m], q_w [], q_x [], q_y [], q_z []\n";
  const Reading r = read("euroc", names + "5000000,1,2,3,0.8,0,0.6,0\n10000000,4,5,6,1,0,0,0\n");
  EXPECT_THAT(r.report.stamps, ElementsAre(0.005, 0.01));
  EXPECT_THAT(r.state(0), ElementsAre(1, 2, 3, 0, 0.6, 0, 0.8));
  EXPECT_EQ(detected("1403636580838555648,1,2,3,0.8,0,0.6,0\n"), "euroc");
  // Names that say seconds, or nothing, and blanks between fields.
  for (const char* time : {"time [s]", "time"}) {
    const std::string spaced = std::string("# ") + time +
                               " x [m] y [m] z [m] qw qx qy qz v_x [m s^-1]\n"
                               "0.5 1 2 3 0.8 0 0.6 0 9\n0.75 1 2 3 1 0 0 0 9\n";
    EXPECT_EQ(detected(spaced), "euroc");
    EXPECT_THAT(read("euroc", spaced).report.stamps, ElementsAre(0.5, 0.75));
    EXPECT_THAT(read("euroc", spaced).state(0), ElementsAre(1, 2, 3, 0, 0.6, 0, 0.8));
  }
}

TEST(Trajectory, PositionsAloneAreNoTrajectoryOfEuroc) {
  const std::string text =
      "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m]\n"
      "1403636580838555648,4.7,-1.8,0.8\n";
  EXPECT_EQ(detected(text), "euroc") << "not a table of id x y theta";
  EXPECT_EQ(refusal("euroc", text),
            "file:2: an EuRoC row with 4 fields; expected 8 fields (8 numbers)");
}

TEST(Trajectory, OtherRowsMayHaveCommasToo) {
  EXPECT_EQ(detected("1,0,0,0,0,1,0,0,0,0,1,0\n"), "kitti");
  EXPECT_THAT(read("kitti", "1,0,0,7,0,1,0,8,0,0,1,9\n").state(0),
              ElementsAre(7, 8, 9, 0, 0, 0, 1));
  EXPECT_TRUE(read("kitti", "1,0,0,7,0,1,0,8,0,0,1,9\n").report.row_ids);
  EXPECT_THAT(read("table", "7,1,2,0.5\n").state(7), ElementsAre(1, 2, 0.5));
  EXPECT_FALSE(read("table", "7,1,2,0.5\n").report.row_ids);
  EXPECT_TRUE(read("table", "1 2 0.5\n").report.row_ids);
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

TEST(Trajectory, TimesAreNoCoordinates) {
  const std::string expected =
      "; expected rows x y theta or id x y theta, or with times those of TUM: time x y z qx qy qz "
      "qw";
  EXPECT_EQ(refusal("table", "1403636580.0 0 0\n1403636580.5 1 0.2\n"),
            "file:1: the first of three columns rises from 1403636580 on, as times since 1970 do" +
                expected);
  EXPECT_EQ(refusal("table", "1403636580123 0 0\n1403636580623 1 0.2\n").substr(0, 41),
            "file:1: the first of three columns rises ");
  EXPECT_EQ(refusal("table", "1403636580.0 0 0 1\n1403636580.5 1 0.2 1\n"),
            "file:1: a row of four numbers begins with 1403636580.0, which is no id" + expected);
  const std::string note =
      "rows are taken for x y theta, though the first column rises as times do, and the third goes "
      "beyond two turns";
  EXPECT_THAT(read("table", "0 0 0\n0.5 1 20\n1 1 25\n").report.notes, ElementsAre(note));
  EXPECT_THAT(read("table", "0 0 0\n0.5 1 20\n0.4 1 25\n").report.notes, IsEmpty());
  EXPECT_THAT(read("table", "0 0 0\n0.5 1 2\n1 1 2.5\n").report.notes, IsEmpty());
}

TEST(Trajectory, IsReadWhateverSeparatesItsNumbers) {
  const Reading points = read("tum", "0.5 1.5 2 3 0 0 0 1\n1 2.5 2 3 0 0 0 1\n");
  for (const char* text :
       {"0.5;1.5;2;3;0;0;0;1\n1;2.5;2;3;0;0;0;1\n", "0,5;1,5;2;3;0;0;0;1\n1,0;2,5;2;3;0;0;0;1\n",
        "t;x;y;z;qx;qy;qz;qw\n0,5; 1,5; 2; 3; 0; 0; 0; 1\n1;2,5;2;3;0;0;0;1\n",
        "0,5 1,5 2 3 0 0 0 1\n1,0 2,5 2 3 0 0 0 1\n"}) {
    EXPECT_EQ(detected(text), "tum") << text;
    const Reading r = read("tum", text);
    EXPECT_EQ(r.report.stamps, points.report.stamps) << text;
    for (const Id id : {0, 1}) EXPECT_EQ(r.state(id), points.state(id)) << text;
  }
}

TEST(Trajectory, WithMoreColumnsSaysHowManyAreExpected) {
  for (const char* more : {" 0.1", " 0.1 0.2", " 1 2 3"}) {
    const std::string row = "0.5 1.5 2 3 0 0 0 1" + std::string(more) + "\n", text = row + row;
    EXPECT_EQ(detected(text), "tum");
    EXPECT_THAT(refusal("tum", text), HasSubstr("fields; expected 8 fields"));
  }
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

TEST(Trajectory, TumHasTheTimesWhereTheyAreKnown) {
  const Reading r = read("tum", "1403715524.907143 1 2 3 0 0 0 1\n1403715526 4 5 6 0 0 0 1\n");
  const std::filesystem::path file = std::filesystem::temp_directory_path() /
                                     ("cairn-times-" + std::to_string(::getpid()) + ".tum");
  write_graph(r.graph, file, registry(), {}, r.report.stamps);
  EXPECT_EQ(read_file(file), "1403715524.907143 1 2 3 0 0 0 1\n1403715526 4 5 6 0 0 0 1\n");
  write_graph(r.graph, file, registry(), {}, std::vector<double>{1.5});  // of another graph
  EXPECT_EQ(read_file(file), "0 1 2 3 0 0 0 1\n1 4 5 6 0 0 0 1\n");
  std::filesystem::remove(file);
  EXPECT_TRUE(writes_poses_alone("a.tum", registry()));
  EXPECT_TRUE(writes_poses_alone("-", registry(), "kitti"));
  EXPECT_FALSE(writes_poses_alone("a.g2o", registry()));
}

/// A velocity, which is nowhere.
struct Velocity : Placeless<3> {
  static constexpr std::string_view kTag = "VERTEX_VELOCITY";
};

TEST(Trajectory, WritesThePosesOfAGraphWithOtherVariables) {
  Reading r = read("g2o", "VERTEX_SE3:QUAT 1 1 2 3 0 0 0 1\nVERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n");
  const auto velocity = define_variable<Velocity>();
  for (const Id id : {100, 101}) r.graph.add_variable(velocity, id, std::array{1.0, 0.0, 0.0});
  EXPECT_EQ(write("tum", r.graph), "0 0 0 0 0 0 0 1\n1 1 2 3 0 0 0 1\n");
  EXPECT_EQ(write("kitti", r.graph), "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 2 0 0 1 3\n");
}

TEST(Trajectory, KittiRefusesIdsThatItsRowsCannotSay) {
  const Reading r = read("table", "0 0 0 0\n2 1 0 0\n");
  EXPECT_EQ(
      write_refusal("kitti", r.graph),
      "format kitti cannot express VERTEX_SE2 2 in row 1; expected poses 0, 1, 2 … or x0, x1, "
      "x2 … without a gap, since the row is the id (format tum keeps ids)");
}

TEST(Trajectory, KittiHasSymbolsByTheirNumbers) {
  const auto line = [](Id id) { return "VERTEX_SE2 " + std::to_string(id) + " 1 2 0\n"; };
  const Reading r = read("g2o", line(symbol('x', 1)) + line(symbol('x', 0)));
  EXPECT_THAT(read("kitti", write("kitti", r.graph)).state(1), ElementsAre(1, 2, 0, 0, 0, 0, 1));
  EXPECT_THAT(
      write_refusal("kitti", read("g2o", line(symbol('x', 0)) + line(symbol('y', 0))).graph),
      HasSubstr("cannot express VERTEX_SE2 y0 in row 1"));
}

TEST(Trajectory, RefusesToWriteNoPoses) {
  EXPECT_THAT(write_refusal("tum", read("g2o", "VERTEX_XY 1 0 0\n").graph),
              HasSubstr("format tum cannot express a graph without a pose"));
  EXPECT_THAT(write_refusal("kitti", Graph()), HasSubstr("the graph is empty"));
}

}  // namespace
}  // namespace cairn::test
