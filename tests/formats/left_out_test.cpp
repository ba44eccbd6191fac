// SPDX-License-Identifier: BSD-3-Clause
// What files leave out, or have without effect: nothing is passed over without a word.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

constexpr const char* kPoses = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n";
const std::string kEdge = "EDGE_SE2 0 1 1 0 0 100 0 0 100 0 400\n";

// Skipped vertices --------------------------------------------------------------------------------

TEST(LeftOut, FactorsOnSkippedVerticesGoWithThem) {
  const std::string text = std::string(kPoses) +
                           "VERTEX_CORNER_XY 10 2 1\nEDGE_SE2_XY 0 10 2 1 100 0 100\n"
                           "EDGE_SE2_XY 1 10 1 1 100 0 100\nFIX 10\n" +
                           kEdge;
  const Reading r = read("g2o", text, {.skip_unknown = true});
  EXPECT_EQ(r.graph.variable_count(), 3);
  EXPECT_EQ(r.graph.factor_count(), 1);
  EXPECT_THAT(r.report.skipped, ElementsAre(Pair("VERTEX_CORNER_XY", 1)));
  EXPECT_THAT(r.report.notes,
              ElementsAre("3 lines left out, on vertices of skipped lines: the first is "
                          "EDGE_SE2_XY 0 10 in line 5, on VERTEX_CORNER_XY 10 of line 4"));
}

TEST(LeftOut, AVertexThatIsNowhereIsRefusedAllTheSame) {
  EXPECT_THAT(refusal("g2o", std::string(kPoses) + "EDGE_ODD 77 1\nEDGE_SE2_XY 0 77 2 1 1 0 1\n",
                      {.skip_unknown = true}),
              HasSubstr("file:5: EDGE_SE2_XY 0 77: there is no vertex 77 in this file"));
}

TEST(LeftOut, WordsOfOtherProgramsMayBeVertices) {
  const Reading r = read("toro",
                         "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nTAG 8 3 4\n"
                         "EDGE2 0 1 1 0 0 1 0 1 1 0 0\nEDGE2 0 8 1 0 0 1 0 1 1 0 0\n",
                         {.skip_unknown = true});
  EXPECT_EQ(r.graph.factor_count(), 1);
  EXPECT_THAT(r.report.notes,
              ElementsAre(HasSubstr("1 line left out, on vertices of skipped lines: "
                                    "EDGE2 0 8 in line 5, on TAG 8 of line 3")));
}

// Vertices of other files -------------------------------------------------------------------------

TEST(LeftOut, FactorsOnVerticesOfAnotherFileOnRequest) {
  const std::string text = kPoses + kEdge + "EDGE_SE2 2 200 1 1 0 1 0 0 1 0 1\n" +
                           "EDGE_SE2 200 201 1 1 0 1 0 0 1 0 1\nFIX 200\n";
  EXPECT_THAT(refusal("g2o", text), HasSubstr("file:5: EDGE_SE2 2 200: there is no vertex 200"));
  EXPECT_THAT(refusal("g2o", text), HasSubstr("ReadOptions::skip_dangling"));
  const Reading r = read("g2o", text, {.skip_dangling = true});
  EXPECT_EQ(r.graph.factor_count(), 1);
  EXPECT_THAT(r.report.notes,
              ElementsAre("3 lines left out, on vertices that this file does not have: the first "
                          "is EDGE_SE2 2 200 in line 5"));
}

TEST(LeftOut, NothingWhereAllVerticesAreThere) {
  EXPECT_THAT(
      read("g2o", kPoses + kEdge, {.skip_unknown = true, .skip_dangling = true}).report.notes,
      IsEmpty());
}

// Without information -----------------------------------------------------------------------------

TEST(WithoutInformation, IsTheIdentityOnRequest) {
  struct Dialect {
    const char* format;
    std::string text;
    std::vector<double> identity;
  };
  const std::vector<double> three = {1, 0, 0, 1, 0, 1}, two = {1, 0, 1};
  const std::vector<double> six = {1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 1};
  for (const Dialect& dialect : std::vector<Dialect>{
           {"g2o", "EDGE_SE2 0 1 1 0 0\n", three},
           {"g2o", "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1\n", six},
           {"g2o", "EDGE_PRIOR_SE2 0 1 0 0\n", three},
           {"g2o", "PARAMS_SE3OFFSET 5 0 0 0 0 0 0 1\nEDGE_SE3_TRACKXYZ 0 1 5 1 0 0\n", three},
           {"toro", "EDGE2 0 1 1 0 0\n", three},
           {"toro", "EDGE3 0 1 1 0 0 0 0 0\n", six},
           {"toro", "LANDMARK 1 0 2 0.5 0\n", two},
           {"toro", "BR 0 1 0.5 2\n", two},
           {"isam", "ODOMETRY 0 1 1 0 0\n", three},
           {"isam", "EDGE3 0 1 1 0 0 0 0 0\n", six},
           {"isam", "LANDMARK 0 1 1 0\n", two}}) {
    EXPECT_THAT(refusal(dialect.format, dialect.text),
                HasSubstr("(ReadOptions::unit_information takes it as the identity)"))
        << dialect.text;
    const Reading r = read(dialect.format, dialect.text, {.unit_information = true});
    EXPECT_EQ(r.information(0), dialect.identity) << dialect.text;
    EXPECT_THAT(r.report.notes,
                ::testing::Contains(
                    HasSubstr("1 factor without information taken as of unit information: ")));
  }
}

TEST(WithoutInformation, OtherFactorsKeepTheirs) {
  const Reading r = read("g2o", kPoses + kEdge + "EDGE_SE2 1 2 1 0 0\nEDGE_SE2 0 2 2 0 0\n",
                         {.unit_information = true});
  EXPECT_THAT(r.information(0), ElementsAre(100, 0, 0, 100, 0, 400));
  EXPECT_THAT(r.information(2), ElementsAre(1, 0, 0, 1, 0, 1));
  EXPECT_THAT(
      r.report.notes,
      ElementsAre("2 factors without information taken as of unit information: the first is "
                  "EDGE_SE2 1 2 in line 5"));
  EXPECT_THAT(
      refusal("g2o", std::string(kPoses) + "EDGE_SE2 0 1 1 0 0 100\n", {.unit_information = true}),
      HasSubstr("EDGE_SE2 with 6 fields"));
}

// Zero information --------------------------------------------------------------------------------

TEST(ZeroInformation, HasNoEffectAndIsNoted) {
  const Reading r = read("g2o", kPoses + kEdge + "EDGE_SE2 0 1 5 5 1 0 0 0 0 0 0\n" +
                                    "EDGE_PRIOR_SE2 2 0 0 0 0.0 0 0 -0 0 0\n");
  EXPECT_EQ(r.graph.factor_count(), 1);
  EXPECT_EQ(r.graph.variable_count(), 3);
  EXPECT_THAT(r.report.notes,
              ElementsAre("2 factors have zero information and no effect (left out): the first is "
                          "EDGE_SE2 0 1 in line 5"));
  for (const char* format : {"toro", "isam"}) {
    const Reading other =
        read(format, "EDGE2 0 1 1 0 0 1 0 1 1 0 1\nEDGE2 1 2 1 0 0 0 0 0 0 0 0\n");
    EXPECT_EQ(other.graph.factor_count(), 1) << format;
    EXPECT_EQ(other.graph.variable_count(), 3) << "what it names is there";
  }
}

TEST(ZeroInformation, IsCheckedOtherwiseLikeAnyFactor) {
  EXPECT_THAT(refusal("g2o", std::string(kPoses) + "EDGE_SE2 0 9 5 5 1 0 0 0 0 0 0\n"),
              HasSubstr("there is no vertex 9"));
}

// Quaternions -------------------------------------------------------------------------------------

TEST(Quaternions, FarFromNormOneAreNoted) {
  const std::string information = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  const Reading r = read("g2o",
                         "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"
                         "VERTEX_SE3:QUAT 1 1 0 0 0.02 0.01 0.31 1\n"
                         "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 2\n"
                         "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 10" +
                             information + "EDGE_PRIOR_SE3:QUAT 0 1 0 0 0 0 0 1.1" + information);
  EXPECT_THAT(r.report.notes, ElementsAre(HasSubstr(
                                  "4 quaternions are not of norm 1 and normalised (expected qx qy "
                                  "qz qw): the first is ")));
  EXPECT_THAT(read("tum", "0 1 2 3 0 0 0 1\n1 1 2 3 1 1 1 1\n").report.notes,
              ElementsAre(HasSubstr("VERTEX_SE3:QUAT 1 in line 2 with the norm 2")));
}

TEST(Quaternions, OfSixDigitsAreNotNoted) {
  EXPECT_THAT(read("g2o",
                   "VERTEX_SE3:QUAT 0 0 0 0 0.182574 0.365148 0.547723 0.730297\n"
                   "VERTEX_SE3:QUAT 1 0 0 0 0.57735 0.57735 0.57735 0\n"
                   "VERTEX_SE2 2 0 0 7\n")
                  .report.notes,
              IsEmpty());
}

}  // namespace
}  // namespace cairn::test
