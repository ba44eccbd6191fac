// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "formats/reading.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::ElementsAre;
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
  const Reading r =
      read("g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE 1 0 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n",
           {.skip_unknown = true});
  EXPECT_EQ(r.graph.variable_count(), 1);
  EXPECT_EQ(r.graph.factor_count(), 0);
  EXPECT_THAT(r.report.notes, ElementsAre(HasSubstr("EDGE_SE2 0 1 in line 3, on VERTEX_SE 1 of "
                                                    "line 2")));
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
