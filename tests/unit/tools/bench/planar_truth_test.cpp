// SPDX-License-Identifier: BSD-3-Clause
#include "planar_truth.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <sstream>
#include <string>

namespace cairn::performance {
namespace {

struct Line {
  std::string tag;
  int id = -1;
  double x = 0.0, y = 0.0, theta = 0.0;
};

Line line(const std::string& text, int number) {
  std::istringstream in(text);
  Line line;
  for (int k = 0; k <= number; ++k) in >> line.tag >> line.id >> line.x >> line.y >> line.theta;
  return line;
}

TEST(PlanarTruth, TurnsTheAxesOfACameraIntoThoseOfARobot) {
  // Straight on for 7 m, 2 m to the left and 0.3 m down.
  const Line pose = line(planar_truth("1 0 0 -2  0 1 0 0.3  0 0 1 7\n"), 0);
  EXPECT_EQ(pose.tag, "VERTEX_SE2");
  EXPECT_EQ(pose.id, 0);
  EXPECT_DOUBLE_EQ(pose.x, 7.0);
  EXPECT_DOUBLE_EQ(pose.y, 2.0);
  EXPECT_DOUBLE_EQ(pose.theta, 0.0);
}

TEST(PlanarTruth, CountsATurnToTheLeftAsPositive) {
  // The camera's z axis points to where -x was: a quarter turn to the left.
  const std::string rows = "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 -1 0 0 1 0 0 1 0 0 0\n";
  const Line pose = line(planar_truth(rows), 1);
  EXPECT_EQ(pose.id, 1);
  EXPECT_DOUBLE_EQ(pose.theta, 0.5 * std::numbers::pi);
}

TEST(PlanarTruth, LeavesOutARowThatIsNotWhole) {
  EXPECT_EQ(planar_truth("1 0 0 0 0 1 0 0 0 0"), "");
}

}  // namespace
}  // namespace cairn::performance
