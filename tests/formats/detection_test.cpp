// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

TEST(Detection, TellsFormatsByTheirTags) {
  EXPECT_EQ(detected("# comment\n\nVERTEX_SE2 0 0 0 0\n"), "g2o");
  EXPECT_EQ(detected("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"), "g2o");
  EXPECT_EQ(detected("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n"), "g2o");
  EXPECT_EQ(detected("VERTEX2 0 0 0 0\nEDGE2 0 1 1 0 0 1 0 1 1 0 0\n"), "toro");
  EXPECT_EQ(detected("VERTEX 0 0 0 0\nEDGE 0 1 1 0 0 1 0 1 1 0 0\n"), "toro");
  EXPECT_EQ(detected("EDGE3 0 1 1 0 0 0 0 0 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"), "isam");
}

TEST(Detection, TellsLandmarksByTheirLength) {
  EXPECT_EQ(detected("LANDMARK 0 1 1 0 10 0 10\n"), "isam");
  EXPECT_EQ(detected("LANDMARK 1 0 1 0 0 10 0 10 0 0 9\n"), "toro");
}

TEST(Detection, TellsEdge2ByItsNumbersWhereThereAreNoVertices) {
  for (const char* tag : {"EDGE2", "ODOMETRY"}) {
    EXPECT_EQ(detected(std::string(tag) + " 0 1 1 0 0 50 0 0 50 0 100\n"), "isam");
    EXPECT_EQ(detected(std::string(tag) + " 0 1 1 0 0 50 0 50 100 0 0\n"), "toro");
  }
}

TEST(Detection, LetsFullMatricesGoWithTheRestOfTheFile) {
  const std::string full = "EDGE2 0 1 1 0 0 9 1 4 16 2 3\n";  // fits both
  EXPECT_EQ(detected(full), "isam") << "no vertices";
  EXPECT_EQ(detected(full + "EDGE2 1 2 1 0 0 50 0 50 100 0 0\n" + full), "toro");
  EXPECT_EQ(detected(full + "EDGE2 1 2 1 0 0 50 0 0 50 0 100\n" + full), "isam");
  EXPECT_EQ(detected(full + full + full + "VERTEX2 0 0 0 0\nVERTEX2 1 0 0 0\n"), "toro");
}

TEST(Detection, IsNotMisledByOneBadLine) {
  const std::string edges = "EDGE2 0 1 1 0 0 50 0 0 50 0 100\nEDGE2 1 2 1 0 0 50 0 0 50 0 100\n";
  EXPECT_EQ(detected("VERTEX2 0 0 0 0\n" + edges + edges), "isam");
  EXPECT_EQ(detected("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\nVERTEX2 2 0 0 0\n"), "g2o");
  EXPECT_EQ(detected("1 2 3\n0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n"), "tum");
  EXPECT_EQ(detected("EDGE2 garbage\n" + edges), "isam");
}

TEST(Detection, TellsTrajectoriesByTheirColumns) {
  EXPECT_EQ(detected("0 1 2 3 0 0 0 1\n"), "tum");
  EXPECT_EQ(detected("1 0 0 0 0 1 0 0 0 0 1 0\n"), "kitti");
  EXPECT_EQ(detected("0 1 2 0.5\n"), "table");
  EXPECT_EQ(detected("1 2 0.5\n"), "table");
  EXPECT_EQ(detected("1 2\n"), "");
  EXPECT_EQ(detected("1\n"), "");
}

TEST(Detection, ARowOfCountsAloneIsNoTable) {
  EXPECT_EQ(detected("0 0 0\n"), "");
  EXPECT_EQ(detected("49 7776 31843\n"), "bal");  // which was cut after its first line
  EXPECT_EQ(detected("0 0 0\n1 0 0\n"), "table");
}

TEST(Detection, LeavesUnknownWordsToTheReaderThatAsksTheRegistry) {
  EXPECT_EQ(detected("RANGE 0 1 2\n"), "g2o");
}

TEST(Detection, KnowsNoBinaryAndNothing) {
  EXPECT_EQ(detected(std::string("VERTEX_SE2 0\0 0 0 0\n", 20)), "");
  EXPECT_EQ(detected("\x89PNG\r\n\x1a\n"), "");
  EXPECT_EQ(detected(""), "");
  EXPECT_EQ(detected("\n  \n#x\n"), "");
}

}  // namespace
}  // namespace cairn::test
