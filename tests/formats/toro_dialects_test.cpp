// SPDX-License-Identifier: BSD-3-Clause
// TORO in space, vertices that are one, landmarks by bearing and range.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::Contains;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pointwise;

const std::string kRows = " 1 2 3 4 5 6 70 8 9 10 11 120 13 14 15 160 17 18 190 20 210\n";

// In space ----------------------------------------------------------------------------------------

TEST(ToroInSpace, ReadsAnglesAndInformationRowByRow) {
  const Reading r = read("toro",
                         "VERTEX3 0 0 0 0 0 0 0\nVERTEX3 1 1 2 3 0.1 0.2 0.3\n"
                         "EDGE3 0 1 1 2 3 0.1 0.2 0.3" +
                             kRows);
  EXPECT_EQ(r.variable_tag(1), "VERTEX_SE3:QUAT");
  EXPECT_EQ(r.factor_tag(0), "EDGE_SE3:QUAT");
  // Rz(0.3) Ry(0.2) Rx(0.1).
  const std::vector<double> expected = {
      1, 2, 3, 0.0342707985504821, 0.1060205110617956, 0.1435721750273919, 0.9833474432563558};
  EXPECT_THAT(r.state(1), Pointwise(DoubleNear(1e-9), expected));
  EXPECT_EQ(r.state(1), r.measurement(0));
  EXPECT_THAT(r.information(0), ElementsAreArray({1,   2,  3,  4,  5,   6,  70, 8,   9,  10, 11,
                                                  120, 13, 14, 15, 160, 17, 18, 190, 20, 210}));
}

TEST(ToroInSpace, IsToldFromIsamByItsVerticesOrItsNumbers) {
  const std::string identity = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  const std::string edge = "EDGE3 0 1 1 0 0 0 0 0" + identity;
  EXPECT_EQ(detected("VERTEX3 0 0 0 0 0 0 0\nVERTEX3 1 0 0 0 0 0 0\n" + edge), "toro");
  EXPECT_EQ(detected(edge), "isam") << "as either, and without vertices";
  // A root whose entries beside the diagonal are too large for information.
  const std::string root = "EDGE3 0 1 1 0 0 0 0 0 1 9 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  EXPECT_EQ(detected(edge + root), "isam");
}

TEST(ToroInSpace, KeepsRotationsWhenItIsWrittenAndRead) {
  std::mt19937_64 engine(3);
  const auto number = [&] { return static_cast<double>(engine() >> 11) * 0x1p-52 - 1.0; };
  Graph graph;
  const auto pose = registry().variable_type("VERTEX_SE3:QUAT");
  const auto edge = registry().factor_type("EDGE_SE3:QUAT");
  const double half = std::sqrt(0.5);
  std::vector<std::vector<double>> poses = {
      {1, 2, 3, 0, half, 0, half}, {1, 2, 3, 0, -half, 0, half},  // a pitch of ±π/2
      {1, 2, 3, half, 0, half, 0}, {1, 2, 3, 0.5, 0.5, -0.5, 0.5}, {0, 0, 0, 1, 0, 0, 0},
      {0, 0, 0, 0, 1, 0, 0},       {0, 0, 0, 0, 0, 1, 0},          {0, 0, 0, 0, 0, 0, 1}};
  for (int k = 0; k < 500; ++k) {
    poses.push_back({});
    for (int i = 0; i < 7; ++i) poses.back().push_back(number());
  }
  std::vector<double> information;
  for (int row = 0; row < 6; ++row) {
    information.push_back(10.0 / 3.0);
    information.insert(information.end(), static_cast<std::size_t>(5 - row), 0.1);
  }
  for (std::size_t k = 0; k < poses.size(); ++k)
    graph.add_variable(pose, static_cast<Id>(k), std::span<const double>(poses[k]));
  for (int k = 0; k + 1 < graph.variable_count(); ++k) {
    graph.add_factor(edge, std::array{k, k + 1},
                     std::span<const double>(poses[static_cast<std::size_t>(k)]), information);
  }
  graph.set_fixed(4);
  const Reading back = read("toro", write("toro", graph));
  ASSERT_EQ(back.graph.variable_count(), graph.variable_count());
  EXPECT_TRUE(back.graph.fixed(4));
  const auto expect_same = [](std::span<const double> a, std::span<const double> b) {
    EXPECT_TRUE(std::equal(a.begin(), a.begin() + 3, b.begin()));
    double dot = 0.0;
    for (std::size_t k = 3; k < 7; ++k) dot += a[k] * b[k];
    for (std::size_t k = 3; k < 7; ++k) EXPECT_NEAR(a[k], std::copysign(1.0, dot) * b[k], 4e-15);
  };
  for (int v = 0; v < graph.variable_count(); ++v) expect_same(graph.state(v), back.graph.state(v));
  for (int f = 0; f < graph.factor_count(); ++f) {
    expect_same(graph.measurement(f), back.graph.measurement(f));
    EXPECT_THAT(back.information(f), ElementsAreArray(graph.information(f)));
  }
}

// One vertex by two names -------------------------------------------------------------------------

constexpr const char* kChain =
    "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nVERTEX2 2 2 0.1 0\nVERTEX2 3 2.1 0 0\n"
    "EDGE2 0 1 1 0 0 100 0 100 400 0 0\nEDGE2 1 2 1 0 0 100 0 100 400 0 0\n"
    "EDGE2 0 3 2.1 0 0 100 0 100 400 0 0\n";

TEST(ToroEquivalence, MakesTwoVerticesOne) {
  const Reading r = read("toro", std::string(kChain) + "FIX 3\nEQUIV 3 2\n");
  EXPECT_EQ(r.graph.variable_count(), 3);
  EXPECT_FALSE(r.graph.find(3));
  EXPECT_THAT(r.state(2), ElementsAre(2, 0.1, 0)) << "of the smaller id";
  EXPECT_THAT(r.ids(2), ElementsAre(0, 2));
  EXPECT_TRUE(r.graph.fixed(2)) << "as either was";
  EXPECT_THAT(
      r.report.notes,
      ElementsAre("EQUIV makes 1 variable one with another, of which the smallest id stays: "
                  "3 and 2 are 2 by line 9"));
}

TEST(ToroEquivalence, GoesOnFromOneToTheNext) {
  const Reading r =
      read("toro", std::string(kChain) +
                       "VERTEX2 4 9 9 0\nVERTEX2 5 9 9 0\nEQUIV 4 5\nEQUIV 5 3\nEQUIV "
                       "2 4\nEQUIV 2 2\n");
  EXPECT_EQ(r.graph.variable_count(), 3);
  EXPECT_THAT(r.ids(2), ElementsAre(0, 2));
}

TEST(ToroEquivalence, LeavesOutWhatWasMeasuredBetweenThem) {
  const Reading r =
      read("toro", std::string(kChain) + "EDGE2 2 3 0.5 0 0 1 0 1 1 0 0\nEQUIV 2 3\n");
  EXPECT_EQ(r.graph.factor_count(), 3);
  EXPECT_THAT(r.report.notes, Contains("1 factor left out, between variables that EQUIV makes one; "
                                       "the first is in line 8"));
}

TEST(ToroEquivalence, NamesAMeasurementThatContradictsIt) {
  const std::string far = "EDGE2 2 3 0.6 0.8 0 100 0 100 100 0 0\nEQUIV 2 3\n";
  EXPECT_THAT(read("toro", std::string(kChain) + far).report.notes,
              Contains("1 factor left out, between variables that EQUIV makes one; the first is in "
                       "line 8. EDGE2 in line 8 contradicts EQUIV: as one variable the two are "
                       "5.77 standard deviations apart, so that one of the two lines is wrong"));
}

TEST(ToroEquivalence, OfAVertexWithItselfIsNone) {
  const Reading r = read("toro", std::string(kChain) + "EQUIV 2 2\n");
  EXPECT_EQ(r.graph.variable_count(), 4);
  EXPECT_THAT(r.report.notes, IsEmpty());
  EXPECT_THAT(read("toro", std::string(kChain) + "EQUIV 2 2\nEQUIV 3 2\n").report.notes,
              ElementsAre(HasSubstr("3 and 2 are 2 by line 9")));
}

TEST(ToroEquivalence, IsRefusedForWhatIsNotThereOrOfAnotherType) {
  EXPECT_EQ(refusal("toro", std::string(kChain) + "EQUIV 2 9\n"),
            "file:8: EQUIV 2 9: there is no vertex 9 in this file");
  EXPECT_EQ(
      refusal("toro", std::string(kChain) + "VERTEX3 9 0 0 0 0 0 0\nEQUIV 2 9\n"),
      "file:9: EQUIV 2 9: 2 is a VERTEX_SE2 and 9 a VERTEX_SE3:QUAT; expected two of one type");
}

TEST(ToroEquivalence, HoldsInAFileWithoutVertices) {
  const Reading r = read("toro",
                         "EDGE2 0 1 1 0 0 1 0 1 1 0 0\nEDGE2 5 2 1 0 0 1 0 1 1 0 0\n"
                         "EQUIV 1 5\n");
  EXPECT_EQ(r.graph.variable_count(), 3);
  EXPECT_THAT(r.state(2), ElementsAre(2, 0, 0));
}

// Bearing and range -------------------------------------------------------------------------------

TEST(ToroBearingAndRange, IsOfStandardDeviations) {
  const Reading r = read("toro",
                         "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nVERTEX2 7 3 4 0\n"
                         "EDGE2 0 1 1 0 0 100 0 100 400 0 0\nBR 1 7 0.5 2 0.1 0.5\n");
  EXPECT_EQ(r.factor_tag(1), "EDGE_BEARING_RANGE_SE2_XY");
  EXPECT_EQ(r.variable_tag(7), "VERTEX_XY");
  EXPECT_THAT(r.ids(1), ElementsAre(1, 7));
  EXPECT_THAT(r.measurement(1), ElementsAre(0.5, 2));
  EXPECT_THAT(r.information(1), Pointwise(DoubleNear(1e-12), std::vector<double>{100, 0, 4}));
  EXPECT_THAT(r.report.notes, IsEmpty());
}

TEST(ToroBearingAndRange, PlacesALandmarkThatHasNoVertex) {
  const Reading r = read("toro",
                         "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 1.5707963267948966\n"
                         "EDGE2 0 1 1 0 0 100 0 100 400 0 0\n"
                         "BR 1 7 0 2 0.1 0.5\nBR 0 7 1 2 0.1 0.5\n");
  EXPECT_THAT(r.state(7), Pointwise(DoubleNear(1e-12), std::vector<double>{1, 2}));
  EXPECT_THAT(r.report.notes, ElementsAre("1 landmark without a vertex: placed where it is first "
                                          "seen"));
}

TEST(ToroBearingAndRange, RefusesWhatIsNone) {
  const std::string poses = "VERTEX2 0 0 0 0\n";
  EXPECT_THAT(refusal("toro", poses + "BR 0 7 0 -2 0.1 0.5\n"),
              HasSubstr("file:2: BR with range -2"));
  EXPECT_EQ(refusal("toro", poses + "VERTEX3 7 0 0 0 0 0 0\nBR 0 7 0 2 0.1 0.5\n"),
            "file:3: BR 0 7: 7 is a VERTEX_SE3:QUAT by line 2; expected a VERTEX_XY");
  for (const char* sigmas : {"0 0.5", "0.1 -1", "1e-200 1"}) {
    EXPECT_THAT(refusal("toro", poses + "BR 0 7 0 2 " + sigmas + "\n"),
                HasSubstr("file:2: BR with the standard deviation"));
  }
  EXPECT_THAT(refusal("toro", poses + "BR 0 7 0 2 0.1\n"),
              HasSubstr("expected 6 fields (2 ids, 2 numbers of the measurement, 2 of the standard "
                        "deviations)"));
}

}  // namespace
}  // namespace cairn::test
