// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "unit/plugins/formats/reading.hpp"

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
      ::testing::EndsWith("; the numbers would fit TORO's order of information (format toro)"));
}

}  // namespace
}  // namespace cairn::test
