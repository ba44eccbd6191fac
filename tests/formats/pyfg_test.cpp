// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "cairn/typed/symbol.hpp"
#include "formats/reading.hpp"
#include "support/data.hpp"

namespace cairn::test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::Pointwise;

const std::string kFile =
    "VERTEX_SE2 0.000000000 A0 5.0 5.0 0.0\n"
    "VERTEX_SE2 1.500000000 A1 6.25 5.0 0.0\n"
    "VERTEX_XY L0 7.0 6.0\n"
    "EDGE_SE2 0.000000000 A0 A1 1.0 0.0 0.5 0.25 0.0 -0.0 0.5 -0.0 0.01\n"
    "EDGE_SE2_XY 0.500000000 A0 L0 2.0 1.0 0.25 0.0 0.25\n";

TEST(Pyfg, HasNamesAndCovariances) {
  const Reading r = read("pyfg", kFile);
  EXPECT_EQ(r.graph.variable_count(), 3);
  EXPECT_EQ(r.variable_tag(symbol('A', 1)), "VERTEX_SE2");
  EXPECT_EQ(r.variable_tag(symbol('L', 0)), "VERTEX_XY");
  EXPECT_THAT(r.ids(0), ElementsAre(symbol('A', 0), symbol('A', 1)));
  EXPECT_THAT(r.measurement(0), ElementsAre(1, 0, 0.5));
  EXPECT_THAT(r.information(0),
              Pointwise(DoubleNear(1e-12), std::vector<double>{4, 0, 0, 2, 0, 100}));
  EXPECT_THAT(r.report.stamps, ElementsAre(0, 1.5));
}

TEST(Pyfg, VerticesAreTheTruthAndNeverTheStart) {
  const Reading r = read("pyfg", kFile);
  EXPECT_THAT(r.state(symbol('A', 0)), ElementsAre(0, 0, 0));
  EXPECT_THAT(r.state(symbol('A', 1)), ElementsAre(1, 0, 0.5));
  EXPECT_THAT(r.state(symbol('L', 0)), ElementsAre(2, 1));
  EXPECT_THAT(r.report.notes,
              ElementsAre("the vertices are the ground truth, and no initial estimate: states were "
                          "propagated along the factors"));
  ASSERT_TRUE(r.report.truth);
  EXPECT_EQ(r.report.truth->factor_count(), r.graph.factor_count());
  const auto truth = [&](Id id) {
    const auto x = r.report.truth->state(*r.report.truth->find(id));
    return std::vector<double>(x.begin(), x.end());
  };
  EXPECT_THAT(truth(symbol('A', 1)), ElementsAre(6.25, 5, 0));
  EXPECT_THAT(truth(symbol('L', 0)), ElementsAre(7, 6));
}

TEST(Pyfg, PriorsAreWhereStatesStart) {
  const Reading r = read("pyfg", kFile + "VERTEX_SE2:PRIOR 0.0 A0 4.0 5.0 0.0 0.25 0 0 0.25 0 1\n" +
                                     "VERTEX_XY:PRIOR 0.0 L0 7 6 1 0 1\n");
  EXPECT_EQ(r.factor_tag(2), "EDGE_PRIOR_SE2");
  EXPECT_THAT(r.information(2), ElementsAre(4, 0, 0, 4, 0, 1));
  EXPECT_EQ(r.factor_tag(3), "EDGE_PRIOR_XY");
  EXPECT_THAT(r.state(symbol('A', 1)), ElementsAre(5, 5, 0.5));
}

TEST(Pyfg, InSpaceToo) {
  const std::string unit = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 0.25 0 0 0.25 0 0.25\n";
  const Reading r = read("pyfg",
                         "VERTEX_SE3:QUAT 0 A0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 A1 1 0 0 0 0 0 1\n"
                         "VERTEX_XYZ L0 1 2 3\nVERTEX_SE3:QUAT:PRIOR 0 A0 0 0 0 0 0 0 1" +
                             unit + "EDGE_SE3:QUAT 0 A0 A1 1 0 0 0 0 0 1" + unit +
                             "EDGE_SE3_XYZ 0 A0 L0 1 2 3 0.5 0 0 0.5 0 0.5\nVERTEX_XYZ:PRIOR 0 L0 "
                             "1 2 3 1 0 0 1 0 1\n");
  EXPECT_EQ(r.factor_tag(0), "EDGE_PRIOR_SE3:QUAT");
  EXPECT_EQ(r.factor_tag(2), "EDGE_SE3_TRACKXYZ");
  EXPECT_EQ(r.factor_tag(3), "EDGE_PRIOR_TRACKXYZ");
  EXPECT_THAT(r.information(1),
              ElementsAre(1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 4, 0, 0, 4, 0, 4));
}

TEST(Pyfg, RangesAreRefusedWithTagAndCount) {
  const std::string text = kFile + "EDGE_RANGE 0.0 A0 L0 2.2 0.1\nEDGE_RANGE 1.0 A1 L0 2.1 0.1\n";
  EXPECT_EQ(refusal("pyfg", text),
            "file:6: EDGE_RANGE in 2 lines: ranges are not read yet (ReadOptions::skip_unknown "
            "leaves them out)");
  const Reading r = read("pyfg", text, {.skip_unknown = true});
  EXPECT_THAT(r.report.skipped, ElementsAre(Pair("EDGE_RANGE", 2)));
  EXPECT_EQ(r.graph.factor_count(), 2);
}

TEST(Pyfg, SeveralRobotsHaveNoCommonCourseOfTime) {
  const Reading r = read("pyfg",
                         "VERTEX_SE2 0 A0 0 0 0\nVERTEX_SE2 0 B0 1 0 0\n"
                         "EDGE_SE2 0 A0 B0 1 0 0 1 0 0 1 0 1\n");
  EXPECT_THAT(r.report.stamps, IsEmpty());
}

TEST(Pyfg, RefusesInItsOwnWords) {
  EXPECT_EQ(
      refusal("pyfg", kFile + "EDGE_SE2 0.0 A0 7 1 0 0 1 0 0 1 0 1\n"),
      "file:6: field 3 of EDGE_SE2 is '7'; expected a name, a letter and a number such as A0");
  EXPECT_THAT(refusal("pyfg", kFile + "EDGE_SE2 0.0 A0 A1 1 0 0 1 0 0 1 0 0\n"),
              HasSubstr("file:6: EDGE_SE2 A0 A1: the covariance matrix is not positive definite"));
  EXPECT_THAT(refusal("pyfg", kFile + "EDGE_SE2 0.0 A0 A1 1 0 0 1 0 0 1 0\n"),
              HasSubstr("expected 12 fields (2 ids, 4 numbers of the measurement, 6 of the "
                        "covariance)"));
  EXPECT_THAT(refusal("pyfg", kFile + "EDGE_SE2 0.0 A0 A7 1 0 0 1 0 0 1 0 1\n"),
              HasSubstr("EDGE_SE2 A0 A7: there is no vertex A7 in this file"));
}

TEST(Pyfg, IsToldFromG2oByItsNames) {
  EXPECT_EQ(detected(kFile), "pyfg");
  EXPECT_EQ(detected("VERTEX_XY L0 1 2\n"), "pyfg");
  EXPECT_EQ(detected("VERTEX_SE2 0 1e5 2 0\n"), "g2o");
}

TEST(Pyfg, OnlyReads) { EXPECT_FALSE(registry().make<Format>("pyfg")->can_write()); }

TEST(Pyfg, ReadsPublishedFilesButTheirRanges) {
  CAIRN_NEEDS_DATA();
  struct File {
    const char* name;
    int variables, factors, ranges;
  };
  for (const File& file :
       {File{"factor_graph_small", 7, 5, 5}, File{"plaza1", 9662, 9657, 3326},
        File{"single_drone", 1755, 1753, 1754}, File{"mrclam3b", 6286, 13840, 1276}}) {
    const auto path = data_folder() / "range" / (std::string(file.name) + ".pyfg");
    if (!std::filesystem::exists(path)) continue;
    ReadReport report;
    const Graph graph = read_graph(path, registry(), {.skip_unknown = true}, report);
    EXPECT_EQ(report.format, "pyfg");
    EXPECT_EQ(graph.variable_count(), file.variables) << file.name;
    EXPECT_EQ(graph.factor_count(), file.factors) << file.name;
    EXPECT_EQ(report.skipped["EDGE_RANGE"], file.ranges) << file.name;
    ASSERT_TRUE(report.truth);
    EXPECT_EQ(report.truth->variable_count(), file.variables);
  }
}

}  // namespace
}  // namespace cairn::test
