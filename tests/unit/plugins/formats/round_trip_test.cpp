// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "unit/plugins/formats/reading.hpp"

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
            "format toro cannot express VERTEX_SE3:QUAT 0; expected a planar pose graph "
            "(VERTEX_SE2, EDGE_SE2) with "
            "ids from 0");
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
