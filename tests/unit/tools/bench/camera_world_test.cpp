// SPDX-License-Identifier: BSD-3-Clause
#include "camera_world.hpp"

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::performance {
namespace {

using ::testing::StartsWith;

/// Straight on, 10 m a step; a turn on the spot by half a turn in the end.
std::string drive(int steps) {
  std::string rows;
  for (int k = 0; k < steps; ++k) rows += fmt::format("1 0 0 0  0 1 0 0  0 0 1 {}\n", 10 * k);
  return rows + fmt::format("-1 0 0 0  0 1 0 0  0 0 -1 {}\n", 10 * (steps - 1));
}

struct Edge {
  int from = 0, to = 0;
  std::vector<double> measurement, information;
};

std::vector<Edge> edges(const std::string& text) {
  std::istringstream in(text);
  std::vector<Edge> all;
  for (std::string tag; in >> tag;) {
    EXPECT_EQ(tag, "EDGE_SE3:QUAT");
    Edge& edge = all.emplace_back();
    in >> edge.from >> edge.to;
    edge.measurement.resize(7);
    edge.information.resize(21);
    for (double& number : edge.measurement) in >> number;
    for (double& number : edge.information) in >> number;
  }
  return all;
}

TEST(CameraWorld, MatchesPairsWithinRangeThatLookTheSameWay) {
  const CameraWorld world = camera_world(drive(5), {.range = 25.0, .matched = 1.0});
  EXPECT_THAT(world.truth,
              StartsWith("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 0 0 10 "));
  std::vector<std::pair<int, int>> pairs;
  for (const Edge& edge : edges(world.measurements)) pairs.emplace_back(edge.from, edge.to);
  // The last looks back: odometry alone is there.
  EXPECT_THAT(pairs, testing::ElementsAre(std::pair(0, 1), std::pair(1, 2), std::pair(0, 2),
                                          std::pair(2, 3), std::pair(1, 3), std::pair(3, 4),
                                          std::pair(2, 4), std::pair(4, 5)));
}

TEST(CameraWorld, HasTheNoiseThatItsInformationSays) {
  const CameraSensor sensor{
      .translation_sigma = 0.05, .rotation_sigma = 0.02, .range = 25.0, .matched = 0.5};
  const std::vector<Edge> all = edges(camera_world(drive(4000), sensor).measurements);
  double forward = 0.0, right = 0.0, turn = 0.0, count = 0.0;
  for (const Edge& edge : all) {
    if (edge.to == 4000) continue;
    EXPECT_NEAR(edge.information[0], 400.0, 1e-9);
    EXPECT_NEAR(edge.information[20], 2500.0, 1e-9);
    right += std::pow(edge.measurement[0], 2);
    forward += std::pow(edge.measurement[2] - 10.0 * (edge.to - edge.from), 2);
    turn += std::pow(2.0 * edge.measurement[4], 2);
    ++count;
  }
  EXPECT_NEAR(count, 3999.0 + 0.5 * 3998.0, 150.0);
  EXPECT_NEAR(std::sqrt(right / count), 0.05, 0.002);
  EXPECT_NEAR(std::sqrt(forward / count), 0.05, 0.002);
  EXPECT_NEAR(std::sqrt(turn / count), 0.02, 0.001);
}

TEST(CameraWorld, IsTheSameForASeed) {
  EXPECT_EQ(camera_world(drive(20), {}).measurements, camera_world(drive(20), {}).measurements);
  EXPECT_NE(camera_world(drive(20), {}).measurements,
            camera_world(drive(20), {.seed = 2}).measurements);
}

TEST(CameraWorld, IsEmptyWithoutPoses) { EXPECT_EQ(camera_world("", {}).truth, ""); }

}  // namespace
}  // namespace cairn::performance
