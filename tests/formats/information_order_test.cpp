// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::ElementsAre;

// All three orders make sense of these six numbers: only the format says what they mean.
const std::string kEdge = " 0 1 1 0 0 9 1 4 16 2 3\n";

TEST(InformationOrder, DependsOnTheFormat) {
  EXPECT_THAT(read("g2o", "EDGE_SE2" + kEdge).information(0), ElementsAre(9, 1, 4, 16, 2, 3));
  EXPECT_THAT(read("toro", "EDGE2" + kEdge).information(0), ElementsAre(9, 1, 2, 4, 3, 16));
  EXPECT_THAT(read("isam", "EDGE2" + kEdge).information(0), ElementsAre(81, 9, 36, 257, 36, 29));
}

TEST(InformationOrder, GivesAHintWhereAnotherOneWouldFit) {
  EXPECT_THAT(
      refusal("g2o", "EDGE_SE2 0 1 1 0 0 44 0 44 31 0 0\n"),
      ::testing::EndsWith("; the numbers would fit TORO's order of information, I11 I12 I22 I33 "
                          "I13 I23, whose tag is EDGE2"));
}

TEST(InformationOrder, ASemidefiniteMatrixIsReadAgainWhateverElseItsNumbersFit) {
  // Rank two, and a diagonal that a root of iSAM could have.
  const Reading line = read("isam", "EDGE2 0 1 1 0 0 50 1 20 0 3 100\n");
  EXPECT_THAT(line.information(0), ElementsAre(2500, 50, 1000, 1, 20, 10409));
  for (const char* format : {"g2o", "toro"}) {
    const Reading back = read(format, write(format, line.graph));
    EXPECT_EQ(difference(line.graph, back.graph), "") << format;
  }
}

}  // namespace
}  // namespace cairn::test
