// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(ConvertCommand, ThereAndBackIsTheSameGraph) {
  const TemporaryFolder folder;
  const std::string g2o = folder.file("graph.g2o"), toro = folder.file("graph.graph"),
                    again = folder.file("again.g2o");
  ASSERT_EQ(cairn({"generate", "manhattan:poses=50", "-o", g2o}).exit_code, 0);
  ASSERT_EQ(cairn({"convert", g2o, toro}).exit_code, 0);
  ASSERT_EQ(cairn({"convert", toro, again}).exit_code, 0);
  EXPECT_THAT(read_text(toro), HasSubstr("VERTEX2 "));
  EXPECT_TRUE(read_text(g2o) == read_text(again));
}

TEST(ConvertCommand, PacksAndUnpacksByTheEnding) {
  const TemporaryFolder folder;
  const std::string packed = folder.file("graph.g2o.gz"), plain = folder.file("graph.g2o");
  ASSERT_EQ(cairn({"generate", "ring", "-o", packed}).exit_code, 0);
  EXPECT_EQ(read_text(packed).substr(0, 2), "\x1f\x8b");
  ASSERT_EQ(cairn({"convert", packed, "-o", plain}).exit_code, 0);
  EXPECT_THAT(read_text(plain), HasSubstr("VERTEX_SE2 0 "));
}

TEST(ConvertCommand, WritesATrajectoryToStandardOutput) {
  const Outcome outcome = cairn({"convert", "@ring:poses=30", "-", "--to", "tum"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(lines(outcome.out).size(), 30u);
}

TEST(ConvertCommand, SaysWhatATrajectoryLeavesOut) {
  const TemporaryFolder folder;
  const std::string graph = folder.file("graph.g2o"), tum = folder.file("poses.tum");
  write_text(graph,
             "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_XY 7 2 3\n"
             "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2_XY 0 7 2 3 1 0 1\n");
  const Outcome outcome = cairn({"convert", graph, tum});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(unfolded(outcome.err),
              HasSubstr("poses.tum: a trajectory has poses alone; left out: 1 VERTEX_XY"));
  EXPECT_THAT(outcome.out, HasSubstr("graph.g2o (g2o): 2 poses written to " + tum));
  EXPECT_EQ(cairn({"convert", tum, folder.file("again.tum")}).err, "");
  EXPECT_EQ(read_text(folder.file("again.tum")), read_text(tum));
}

// Two metres ahead, in the axes of a camera; then a turn to the left.
TEST(ConvertCommand, TurnsTheAxesOfACameraToThoseOfARobot) {
  CAIRN_NEEDS("variable", "VERTEX_SE3:QUAT");
  const TemporaryFolder folder;
  const std::string kitti = folder.file("00.txt"), tum = folder.file("00.tum");
  write_text(kitti, "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 -1 0 0 1 0 -0.5 1 0 0 2\n");
  const Outcome kept = cairn({"convert", kitti, tum});
  EXPECT_THAT(unfolded(kept.err), HasSubstr("KITTI's axes are those of a camera, and are kept; "
                                            "--axes camera turns them"));
  EXPECT_THAT(read_text(tum), HasSubstr("1 0 -0.5 2 "));
  const Outcome turned = cairn({"convert", kitti, tum, "--axes", "camera"});
  EXPECT_EQ(turned.exit_code, 0) << turned.err;
  EXPECT_THAT(turned.err, Not(HasSubstr("axes")));
  EXPECT_THAT(read_text(tum), HasSubstr("1 2 0 0.5 "));
  const Outcome planar = cairn({"convert", "@ring", tum, "--axes", "camera"});
  EXPECT_EQ(planar.exit_code, 3);
  EXPECT_THAT(planar.err, HasSubstr("@ring: --axes camera: "));
}

TEST(ConvertCommand, NeedsAFormatWhereTheNameTellsNone) {
  const TemporaryFolder folder;
  const Outcome outcome = cairn({"convert", "@ring", folder.file("graph.docx")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr(".g2o"));
  EXPECT_TRUE(folder.contents().empty());
  EXPECT_THAT(outcome.err, HasSubstr("--to"));
  EXPECT_EQ(cairn({"convert", "@ring", folder.file("GRAPH.G2O")}).exit_code, 0);
  EXPECT_EQ(cairn({"convert", "@ring", folder.file("graph.docx"), "--to", "g2o"}).exit_code, 0);
}

TEST(ConvertCommand, StandardOutputIsG2oUnlessToldOtherwise) {
  const Outcome pipe = cairn({"convert", "@ring:poses=20", "-"});
  EXPECT_EQ(pipe.exit_code, 0) << pipe.err;
  EXPECT_EQ(pipe.out, cairn({"convert", "@ring:poses=20", "-", "--to", "g2o"}).out);
  EXPECT_NE(pipe.out, cairn({"convert", "@ring:poses=20", "-", "--to", "toro"}).out);
}

TEST(ConvertCommand, TheFormatOfTheInputMayBeForced) {
  const TemporaryFolder folder;
  write_text(folder.file("edges.txt"), "EDGE2 0 1 1 0 0 2 0 0 2 0 2\n");
  const Outcome outcome =
      cairn({"convert", folder.file("edges.txt"), "-", "--from", "isam", "--to", "g2o"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("EDGE_SE2 0 1 1 0 0 4 0 0 4 0 4"));  // squared
  EXPECT_EQ(
      cairn({"convert", folder.file("edges.txt"), "-", "--from", "isma", "--to", "g2o"}).exit_code,
      5);
}

}  // namespace
}  // namespace cairn::test
