// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "integration/process.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

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
