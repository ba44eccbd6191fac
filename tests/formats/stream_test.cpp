// SPDX-License-Identifier: BSD-3-Clause
// g2o as it comes, line by line: what the reader of files says of the same text.
#include "cairn/io/stream_format.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class Stream : public testing::Test {
 protected:
  StreamLine read(std::string_view line, const ReadOptions& options = {}) {
    return stream_->read(line, "file", ++number_, registry(), options);
  }
  std::string refusal_of(std::string_view line) {
    try {
      read(line);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::input);
      return error.what();
    }
    return "";
  }
  std::unique_ptr<StreamFormat> stream_ = registry().make<StreamFormat>("g2o");
  std::int64_t number_ = 0;
};

TEST_F(Stream, SaysWhatALineHolds) {
  const StreamLine vertex = read("VERTEX_SE2 7 1 2 0.5");
  ASSERT_THAT(vertex.variables, SizeIs(1));
  EXPECT_EQ(vertex.variables[0].id, 7);
  EXPECT_EQ(vertex.variables[0].type->tag(), "VERTEX_SE2");
  EXPECT_THAT(vertex.variables[0].state, ElementsAre(1, 2, 0.5));
  EXPECT_THAT(read("FIX 7 8").held, ElementsAre(7, 8));
  const StreamLine edge = read("EDGE_SE2 7 8 1 0 0.1 1 0 0 2 0 3  # seen at noon\r");
  ASSERT_THAT(edge.factors, SizeIs(1));
  EXPECT_THAT(edge.factors[0].variables, ElementsAre(7, 8));
  EXPECT_THAT(edge.factors[0].measurement, ElementsAre(1, 0, 0.1));
  EXPECT_THAT(edge.factors[0].information, ElementsAre(1, 0, 0, 2, 0, 3));
  EXPECT_THAT(read("").factors, IsEmpty());
  EXPECT_THAT(read("# nothing").variables, IsEmpty());
}

TEST_F(Stream, RefusesInTheWordsOfTheFilesReader) {
  const std::vector<std::string> bad = {
      "EDGE_SE2 0 1 1 0 0 1 0 0 1 0",    "VERTEX_SE2 x 0 0 0", "VERTEX_SE2 1 0 0 nan",
      "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 -1", "EDGE_SE9 1 2",       "FIX",
      "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 0"};
  std::string before;
  for (const std::string& line : bad) {
    EXPECT_EQ(refusal_of(line), refusal("g2o", before + line + "\n"));
    before += "\n";  // so that the line has its number in the file as well
  }
}

TEST_F(Stream, LeavesOutUnknownLinesWhereThatIsAskedFor) {
  EXPECT_TRUE(read("EDGE_SE9 1 2", {.skip_unknown = true}).skipped);
  EXPECT_FALSE(read("FIX 1", {.skip_unknown = true}).skipped);
}

TEST_F(Stream, RemembersTheOffsetsOfSensors) {
  EXPECT_THAT(refusal_of("EDGE_SE3_TRACKXYZ 0 1 5 1 2 3 1 0 0 1 0 1"),
              HasSubstr("file:1: EDGE_SE3_TRACKXYZ refers to parameter 5"));
  read("PARAMS_SE3OFFSET 5 10 0 0 0 0 0 1");
  EXPECT_THAT(read("EDGE_SE3_TRACKXYZ 0 1 5 1 2 3 1 0 0 1 0 1").factors[0].measurement,
              ElementsAre(11, 2, 3));
  read("PARAMS_SE3OFFSET 5 10 0 0 0 0 0 1");  // as it was
  EXPECT_THAT(refusal_of("PARAMS_SE3OFFSET 5 0 0 0 0 0 0 1"),
              HasSubstr("line 2 gives other numbers for this id"));
}

TEST_F(Stream, NotesWhatItChanges) {
  EXPECT_THAT(read("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 2").notes,
              ElementsAre("1 quaternion is not of norm 1 and normalised (expected qx qy qz qw): "
                          "VERTEX_SE3:QUAT 0 in line 1 with the norm 2"));
  const StreamLine corridor =
      read("EDGE_SE2 0 1 1.01 0 0.01 307121 -243387 -342143 192879 271141 1.6817e+07");
  EXPECT_THAT(corridor.notes, ElementsAre(HasSubstr("less than rounding changes its numbers")));
  EXPECT_THAT(read("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1").notes, IsEmpty());
}

TEST_F(Stream, RefusesAMeasurementOfNothing) {
  EXPECT_EQ(refusal_of("EDGE_SE2 0 1 1 0 0 0 0 0 0 0 0"),
            "file:1: the information of EDGE_SE2 0 1 is zero: it would have no effect");
}

TEST(WhatMarginalizationLeaves, HasNoPlaceInAFile) {
  Graph graph;
  const auto pose = registry().variable_type("VERTEX_SE2");
  graph.add_variable(pose, 3, std::array{0.0, 0.0, 0.0});
  const auto prior =
      std::make_shared<MarginalPrior>(std::vector<MarginalPrior::Variable>{{pose, {0.0, 0.0, 0.0}}},
                                      LinearResidual{1, 3, {1, 0, 0}, {0}}, 0);
  graph.add_factor(prior, std::array{0}, {}, std::array{1.0});
  EXPECT_THAT(write_refusal("g2o", graph), HasSubstr("cannot express MARGINAL_PRIOR 3"));
  EXPECT_THAT(write_refusal("toro", graph), HasSubstr("cannot express"));
  EXPECT_EQ(write_refusal("tum", graph), "");
}

}  // namespace
}  // namespace cairn::test
