// SPDX-License-Identifier: BSD-3-Clause
// Numbers that formats may lose digits of: headings of ±π, half turns, coordinates far out, and
// information of any size.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <string>

#include "formats/reading.hpp"

namespace cairn::test {
namespace {

constexpr double kPi = std::numbers::pi;

/// Written and read back: every number as it was, or, of angles, the same one.
void expect_kept(const Graph& graph, const std::string& format) {
  const Reading r = read(format, registry().make<Format>(format)->write(graph));
  ASSERT_EQ(r.graph.variable_count(), graph.variable_count()) << format;
  ASSERT_EQ(r.graph.factor_count(), graph.factor_count()) << format;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const int found = *r.graph.find(graph.id(v));
    EXPECT_THAT(r.graph.state(found), testing::ElementsAreArray(graph.state(v))) << format;
  }
  for (int f = 0; f < graph.factor_count(); ++f) {
    EXPECT_THAT(r.graph.measurement(f), testing::ElementsAreArray(graph.measurement(f))) << format;
    EXPECT_THAT(r.graph.information(f), testing::ElementsAreArray(graph.information(f))) << format;
  }
}

TEST(EdgeNumbers, OfThePlaneAreKept) {
  for (const double scale : {1e-60, 1e-30, 1e-5, 1.0, 1e5, 1e30, 1e60}) {
    Graph graph;
    const auto pose = registry().variable_type("VERTEX_SE2");
    const auto edge = registry().factor_type("EDGE_SE2");
    Id id = 0;
    for (const double heading : {kPi, -kPi, 3.1415926535897927, 0.0}) {
      const double x[] = {4e5 + 0.1, 5e6 + 1e-9, heading};
      graph.add_variable(pose, id++, x);
    }
    for (int k = 0; k + 1 < graph.variable_count(); ++k) {
      const int ends[] = {k, k + 1};
      const double z[] = {1e9 + 1e-7, -1e-9, k % 2 == 0 ? kPi : -kPi};
      const double information[] = {3 * scale, 0.1 * scale, 0, 2 * scale, 0, scale / 3};
      graph.add_factor(edge, ends, z, information);
    }
    for (const char* format : {"g2o", "toro"}) expect_kept(graph, format);
  }
}

TEST(EdgeNumbers, OfSpaceAreKept) {
  Graph graph;
  const auto pose = registry().variable_type("VERTEX_SE3:QUAT");
  const auto edge = registry().factor_type("EDGE_SE3:QUAT");
  const double quaternions[][4] = {{1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, 1, 0}, {0.6, 0, -0.8, 0}};
  Id id = 0;
  for (const auto& q : quaternions) {
    const double x[] = {4e5 + 0.1, 5e6 + 1e-9, 100.1, q[0], q[1], q[2], q[3]};
    graph.add_variable(pose, id++, x);
  }
  std::vector<double> information;
  for (int row = 0; row < 6; ++row) {
    information.push_back(1e-30 / 3.0);
    information.insert(information.end(), static_cast<std::size_t>(5 - row), 1e-32);
  }
  for (int k = 0; k + 1 < graph.variable_count(); ++k) {
    const int ends[] = {k, k + 1};
    const auto& q = quaternions[k];
    const double z[] = {0.1, 1e9 + 1e-7, 1e-9, q[0], q[1], q[2], q[3]};
    graph.add_factor(edge, ends, z, information);
  }
  expect_kept(graph, "g2o");
}

}  // namespace
}  // namespace cairn::test
