// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;

/// Numbers with all their digits, of all sizes, the same on every machine.
class Numbers {
 public:
  double next() {
    // Not std::normal_distribution, whose numbers differ between standard libraries.
    const double unit = static_cast<double>(engine_() >> 11) * 0x1p-53;
    const int exponent = static_cast<int>(engine_() % 60) - 30;
    return std::ldexp(unit - 0.5, exponent);
  }
  double angle() { return (static_cast<double>(engine_() >> 11) * 0x1p-53 - 0.5) * 6.28; }

 private:
  std::mt19937_64 engine_{7};
};

std::span<const double> as_span(const std::vector<double>& v) { return v; }

/// A diagonally dominant upper triangle.
std::vector<double> information(int n, Numbers& numbers) {
  std::vector<double> triangle;
  for (int row = 0; row < n; ++row) {
    for (int column = row; column < n; ++column) {
      const double value = std::sin(numbers.next());
      triangle.push_back(row == column ? 10.0 + value : value);
    }
  }
  return triangle;
}

std::vector<double> quaternion_pose(Numbers& numbers) {
  std::vector<double> pose;
  for (int k = 0; k < 3; ++k) pose.push_back(numbers.next());
  for (int k = 0; k < 4; ++k) pose.push_back(numbers.angle());
  return pose;
}

Graph planar_graph(int poses) {
  Numbers numbers;
  Graph graph;
  const auto pose = registry().variable_type("VERTEX_SE2");
  const auto edge = registry().factor_type("EDGE_SE2");
  for (int i = 0; i < poses; ++i) {
    graph.add_variable(pose, 3 * i, as_span({numbers.next(), numbers.next(), numbers.angle()}));
  }
  for (int i = 0; i < poses; ++i) {
    const int ends[2] = {i, (i * 7 + 1) % poses};
    if (ends[0] == ends[1]) continue;
    graph.add_factor(edge, ends, as_span({numbers.next(), numbers.next(), numbers.angle()}),
                     information(3, numbers));
  }
  graph.set_fixed(2);
  return graph;
}

Graph mixed_graph(int poses) {
  Numbers numbers;
  Graph graph;
  Registry& types = registry();
  for (int i = 0; i < poses; ++i) {
    graph.add_variable(types.variable_type("VERTEX_SE3:QUAT"), i, quaternion_pose(numbers));
  }
  graph.add_variable(types.variable_type("VERTEX_TRACKXYZ"), 5000,
                     as_span({numbers.next(), numbers.next(), numbers.next()}));
  graph.add_variable(types.variable_type("VERTEX_SE2"), 6000,
                     as_span({numbers.next(), numbers.next(), numbers.angle()}));
  graph.add_variable(types.variable_type("VERTEX_XY"), 9007199254740993,
                     as_span({numbers.next(), numbers.next()}));
  for (int i = 1; i < poses; ++i) {
    const int ends[2] = {i, i - 1}, seen[2] = {i, poses}, one[1] = {i};
    graph.add_factor(types.factor_type("EDGE_SE3:QUAT"), ends, quaternion_pose(numbers),
                     information(6, numbers));
    graph.add_factor(types.factor_type("EDGE_SE3_TRACKXYZ"), seen,
                     as_span({numbers.next(), numbers.next(), numbers.next()}),
                     information(3, numbers));
    graph.add_factor(types.factor_type("EDGE_PRIOR_SE3:QUAT"), one, quaternion_pose(numbers),
                     information(6, numbers));
  }
  const int planar[2] = {poses + 1, poses + 2};
  graph.add_factor(types.factor_type("EDGE_BEARING_RANGE_SE2_XY"), planar,
                   as_span({numbers.angle(), std::abs(numbers.next())}), information(2, numbers));
  graph.set_fixed(0);
  graph.set_fixed(poses + 2);
  return graph;
}

TEST(RoundTrip, G2oKeepsEveryBit) {
  for (const Graph& graph : {planar_graph(1000), mixed_graph(1000)}) {
    EXPECT_EQ(difference(graph, read("g2o", write("g2o", graph)).graph), "");
  }
}

TEST(RoundTrip, ToroKeepsEveryBit) {
  const Graph graph = planar_graph(1000);
  EXPECT_EQ(difference(graph, read("toro", write("toro", graph)).graph), "");
}

struct Sample {
  const char* format;
  std::string text;
  bool writes;
};
std::vector<Sample> samples() {
  const std::string six = " 9 1 0 0 0 0 9 0 0 0 0 9 0 0 0 9 0 0 9 0 9\n";
  return {
      {"g2o",
       "VERTEX_SE2 0 0 0 0\nVERTEX_XY 5 1 2\nVERTEX_XY 6 2 2\nFIX 0\n"
       "EDGE_SE2_XY 0 5 1 2 4 1 4\nEDGE_POINTXY 5 6 1 0 4 1 4\n",
       true},
      {"g2o",
       "VERTEX_TRACKXYZ 0 0 0 0\nVERTEX_TRACKXYZ 1 1 2 3\n"
       "EDGE_POINTXYZ 0 1 1 2 3 4 1 0 4 0 4\n",
       true},
      {"toro", "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0.5\nEDGE2 0 1 1 0 0.5 9 1 8 7 2 3\nFIX 1\n", true},
      {"toro", "VERTEX3 0 0 0 0 0 0 0\nVERTEX3 1 1 2 3 0 0 0\nEDGE3 0 1 1 2 3 0 0 0" + six, true},
      {"toro",
       "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0.5\nVERTEX2 2 1 0 0.5\n"
       "EDGE2 0 2 1 0 0.5 9 1 8 7 2 3\nEQUIV 1 2\n",
       true},
      {"bal", "1 1 1\n0 0 1 2\n0.1\n0.2\n0.3\n1\n2\n-3\n500\n0\n0\n1\n2\n-30\n", true},
      {"tum", "0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0.6 0.8\n", true},
      {"kitti", "1 0 0 0 0 1 0 0 0 0 1 0\n0 -1 0 7 1 0 0 8 0 0 1 9\n", true},
      {"isam", "EDGE3 0 1 1 0 0 0.1 0.2 0.3" + six, false},
      {"pyfg",
       "VERTEX_SE2 0 A0 0 0 0\nVERTEX_SE2 1 A1 1 0 0\n"
       "EDGE_SE2 0 A0 A1 1 0 0 0.25 0 0 0.25 0 0.5\n",
       false},
      {"table", "0 1 2 0.5\n1 2 2 0.5\n", false},
  };
}

TEST(RoundTrip, EveryDialectIsWrittenAsItWasReadOrIsKnownNotToBe) {
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.format + (": " + sample.text));
    EXPECT_EQ(registry().make<Format>(sample.format)->can_write(), sample.writes);
    const Reading first = read(sample.format, sample.text);
    EXPECT_EQ(difference(first.graph, read("g2o", write("g2o", first.graph)).graph), "");
    if (!sample.writes) continue;
    const Reading again = read(sample.format, write(sample.format, first.graph));
    const std::string differs = difference(first.graph, again.graph);
    // A rotation vector in place of a quaternion is rounded.
    EXPECT_EQ(differs, sample.format == std::string("bal") ? differs : "");
    EXPECT_EQ(again.graph.variable_count(), first.graph.variable_count());
    EXPECT_EQ(again.graph.factor_count(), first.graph.factor_count());
  }
}

TEST(RoundTrip, WhatToroHasNoTagForIsNamed) {
  for (const char* text :
       {"VERTEX2 0 0 0 0\nBR 0 7 0.5 2 0.1 0.5\n",
        "VERTEX2 0 0 0 0\nVERTEX2 2 5 4 0\nLANDMARK 2 0 5 -0.5 0 9 0 9 0 0 9\n"}) {
    EXPECT_THAT(write_refusal("toro", read("toro", text).graph),
                HasSubstr("format toro cannot express VERTEX_XY"));
  }
}

TEST(RoundTrip, TumKeepsEveryBitOfSpatialPoses) {
  const Graph graph = mixed_graph(1000);
  const Reading back = read("tum", write("tum", graph));
  for (int i = 0; i < 1000; ++i) {
    EXPECT_TRUE(std::ranges::equal(graph.state(i), back.graph.state(*back.graph.find(i))));
  }
}

TEST(RoundTrip, WritingAgainGivesTheSameText) {
  const std::string text = write("g2o", mixed_graph(100));
  EXPECT_EQ(write("g2o", read("g2o", text).graph), text);
}

TEST(RoundTrip, G2oIsWrittenByIdWithFixAndFactorsInOrder) {
  const Reading r = read("g2o",
                         "VERTEX_SE2 5 1 0 0\nVERTEX_SE2 2 0.1 0 0\nFIX 5\n"
                         "EDGE_SE2 5 2 1 0 0 1 0 0 1 0 1\nEDGE_PRIOR_SE2 2 0 0 0 1 0 0 1 0 1\n"
                         "EDGE_SE2 2 5 1 0 0 1 0 0 1 0 1\n");
  EXPECT_EQ(write("g2o", r.graph),
            "VERTEX_SE2 2 0.1 0 0\nVERTEX_SE2 5 1 0 0\nFIX 5\n"
            "EDGE_SE2 5 2 1 0 0 1 0 0 1 0 1\nEDGE_PRIOR_SE2 2 0 0 0 1 0 0 1 0 1\n"
            "EDGE_SE2 2 5 1 0 0 1 0 0 1 0 1\n");
}

TEST(RoundTrip, G2oIsWrittenSoThatG2oReadsIt) {
  const std::string text = write("g2o", mixed_graph(2));
  EXPECT_THAT(text, ::testing::StartsWith("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n"));
  EXPECT_THAT(text, HasSubstr("\nEDGE_SE3_TRACKXYZ 1 5000 0 "));
  EXPECT_THAT(text, HasSubstr("\nEDGE_SE3_PRIOR 1 0 "));
}

TEST(RoundTrip, ToroRefusesWhatItCannotExpress) {
  EXPECT_EQ(write_refusal("toro", mixed_graph(2)),
            "format toro cannot express VERTEX_TRACKXYZ 5000; expected a pose graph in the plane "
            "(VERTEX_SE2, EDGE_SE2) or in space (VERTEX_SE3:QUAT, EDGE_SE3:QUAT) with ids from 0");
  const Reading prior = read("g2o", "VERTEX_SE2 4 0 0 0\nEDGE_PRIOR_SE2 4 0 0 0 1 0 0 1 0 1\n");
  EXPECT_THAT(write_refusal("toro", prior.graph),
              HasSubstr("format toro cannot express EDGE_PRIOR_SE2 4;"));
}

TEST(RoundTrip, AnEmptyGraphIsNotWritten) {
  for (const char* format : {"g2o", "toro", "tum", "kitti"}) {
    EXPECT_EQ(write_refusal(format, Graph()), "the graph is empty: there is nothing to write");
  }
}

}  // namespace
}  // namespace cairn::test
