// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/components.hpp"
#include "unit/plugins/formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

TEST(BadFile, NothingInItIsAnErrorInEveryFormat) {
  for (const char* format : {"g2o", "toro", "isam", "bal", "tum", "kitti", "table"}) {
    for (const char* text : {"", "\n\n", "# only a comment\r\n"}) {
      EXPECT_EQ(refusal(format, text), "file: the file holds no variable and no factor") << format;
    }
  }
}

TEST(BadFile, NothingLeftAfterSkippingIsAnError) {
  EXPECT_EQ(refusal("g2o", "VERTEX_ODD 1 2\nEDGE_ODD 3\n", {.skip_unknown = true}),
            "file: the file holds no variable and no factor (2 lines with unknown tags skipped)");
}

TEST(BadFile, SkippedVerticesDoNotComeBackByThemselves) {
  CAIRN_NEEDS("types", "slam2d");
  EXPECT_THAT(
      refusal("g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE 1 0 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n",
              {.skip_unknown = true}),
      HasSubstr("file:3: EDGE_SE2 0 1: there is no vertex 1"));
}

TEST(BadFile, TooManyTagsAreStillNamedByTheFirst) {
  EXPECT_THAT(refusal("toro", "VERTEX_SE2 0 0 0 0\n"),
              HasSubstr("file:1: unknown tag 'VERTEX_SE2'"));
  EXPECT_THAT(refusal("isam", "hello world\n"), HasSubstr("file:1: unknown tag 'hello'"));
}

TEST(BadFile, TheFirstDuplicateInTheFileIsNamed) {
  EXPECT_EQ(refusal("g2o", "VERTEX_XY 9 0 0\nVERTEX_XY 1 0 0\nVERTEX_XY 9 0 0\nVERTEX_XY 1 0 0\n"),
            "file:3: VERTEX_XY 9: the id was already given in line 1; expected every id once");
}

}  // namespace
}  // namespace cairn::test
