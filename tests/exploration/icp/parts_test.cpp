// SPDX-License-Identifier: BSD-3-Clause
// The parts of the scan matcher, each against its definition.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "correlation.hpp"
#include "generated_floors.hpp"
#include "match_covariance.hpp"
#include "nearest_points.hpp"
#include "point_to_line.hpp"
#include "support/sampling.hpp"
#include "surface_scan.hpp"
#include "visibility.hpp"

namespace cairn::icp {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

TEST(NearestPoints, AreThoseOfComparingWithAll) {
  test::Sampler random(1);
  const auto point = [&] {
    const double x = random.uniform(-3.0, 3.0);
    return Vector2d(x, random.uniform(-3.0, 3.0));
  };
  std::vector<Vector2d> points;
  for (int k = 0; k < 200; ++k) points.push_back(point());
  const NearestPoints tree(points);
  for (int k = 0; k < 500; ++k) {
    const Vector2d at = point();
    int nearest = -1;
    double least = 0.3;
    for (int i = 0; i < 200; ++i) {
      const double distance = (points[static_cast<std::size_t>(i)] - at).norm();
      if (distance < least) {
        least = distance;
        nearest = i;
      }
    }
    EXPECT_EQ(tree.nearest(at, 0.3), nearest);
  }
  EXPECT_EQ(NearestPoints().nearest(Vector2d::Zero(), 1.0), -1);
}

TEST(SurfaceScan, LinesDoNotReachAroundCorners) {
  test::Walls room;
  room.polygon({{-1, -2}, {2, -2}, {2, 2}, {-1, 2}});
  const SurfaceScan scan(room.scan(Pose2()));
  EXPECT_EQ(scan.size(), 181);
  EXPECT_EQ(scan.line_count(), 181);
  for (int k = 0; k < scan.size(); ++k) {
    const SurfaceLine& line = scan.line(k);
    const bool ahead = scan.point(k).x() > 1.999;
    const bool on_corner = ahead && std::abs(scan.point(k).y()) > 1.999;
    if (on_corner) continue;
    const Vector2d normal = ahead ? Vector2d(-1, 0) : Vector2d(0, scan.point(k).y() > 0 ? -1 : 1);
    EXPECT_NEAR(line.normal.dot(normal), 1.0, 1e-6) << "point " << k;
    EXPECT_NEAR(line.normal.dot(scan.point(k) - line.centre), 0.0, 1e-6);
  }
}

TEST(SurfaceScan, FindsTheNoiseOfRanges) {
  for (const double sigma : {0.01, 0.02, 0.05}) {
    double mean = 0.0;
    for (unsigned seed = 1; seed <= 20; ++seed) {
      const LaserScan scan = test::furnished_room().scan(Pose2(1.5, 1.8, 0.1 * seed));
      mean += SurfaceScan(test::with_noise(scan, sigma, seed), {.sigma = 0.001}).sigma() / 20;
    }
    EXPECT_NEAR(mean, sigma, 0.2 * sigma);
  }
}

TEST(Visibility, CountsWhatTheOtherLidarSees) {
  test::Walls wall, nearer;
  wall.segments.push_back({{3, -20}, {3, 20}});
  nearer.segments.push_back({{2, -20}, {2, 20}});
  const LidarModel lidar{.aperture = 1.0, .beams = 51};
  const SurfaceScan far_wall(wall.scan(Pose2(), lidar)), near_wall(nearer.scan(Pose2(), lidar));
  const Visibility same = visibility(far_wall, far_wall, Pose2(), 0.05);
  EXPECT_EQ(same.agreeing, 51);
  EXPECT_EQ(same.conflict(), 0.0);
  EXPECT_EQ(visibility(far_wall, near_wall, Pose2(), 0.05).in_front, 51);
  EXPECT_EQ(visibility(near_wall, far_wall, Pose2(), 0.05).behind, 51);
  EXPECT_EQ(visibility(far_wall, far_wall, Pose2(0, 0, 1.5), 0.05).outside, 51);
  EXPECT_EQ(mutual_visibility(far_wall, near_wall, Pose2(), 0.05).seen(), 102);
}

TEST(Correlation, IsHighestNearTheTruth) {
  const test::Walls room = test::furnished_room();
  const Pose2 first(1.5, 1.8, 0.2), truth(0.64, -0.33, 0.3);
  const SurfaceScan earlier(room.scan(first)), later(room.scan(first * truth));
  const auto candidates = Correlation(earlier, SearchWindow{}).search(later, Pose2());
  ASSERT_FALSE(candidates.empty());
  EXPECT_NEAR(candidates[0].pose.x(), truth.x(), 0.1);
  EXPECT_NEAR(candidates[0].pose.y(), truth.y(), 0.1);
  EXPECT_NEAR(candidates[0].pose.theta(), truth.theta(), 0.03);
  EXPECT_GT(candidates[0].score, 0.7);
  for (std::size_t k = 1; k < candidates.size(); ++k)
    EXPECT_LE(candidates[k].score, candidates[k - 1].score);
}

TEST(PointToLine, TheDerivativesAreThoseOfTheResiduals) {
  const test::Walls room = test::furnished_room();
  const Pose2 first(1.5, 1.8, 0.2), truth(0.6, 0.3, 0.3);
  const SurfaceScan earlier(room.scan(first)), later(room.scan(first * truth));
  const PointToLine point_to_line(earlier, later);
  const Pose2 pose = truth * Pose2(0.01, -0.02, 0.005);
  const auto residual = [&](const PointMatch& match, const Pose2& at) {
    const SurfaceLine& line = (match.inverse ? later : earlier).line(match.line);
    const Vector2d point =
        match.inverse ? at.inverse() * earlier.point(match.point) : at * later.point(match.point);
    return line.normal.dot(point - line.centre);
  };
  const std::vector<PointMatch> matches = point_to_line.match(pose, 0.2);
  ASSERT_GT(matches.size(), 200U);
  constexpr double kStep = 1e-6;
  for (const PointMatch& match : matches) {
    EXPECT_NEAR(residual(match, pose), match.residual, 1e-12);
    for (int k = 0; k < 3; ++k) {
      const Vector3d xi = kStep * Vector3d::Unit(k);
      const double slope =
          (residual(match, pose.retract(xi)) - residual(match, pose.retract(-xi))) / (2 * kStep);
      EXPECT_NEAR(match.J[k], slope, 1e-6);
    }
  }
}

TEST(MatchCovariance, WithoutMatchesNothingIsObserved) {
  const SurfaceScan empty{LaserScan{}};
  const MatchCovariance none = match_covariance(empty, empty, {}, {.unobserved = 2.0});
  EXPECT_EQ(none.unobserved, 3);
  EXPECT_EQ(none.covariance, 4.0 * Eigen::Matrix3d::Identity());
}

}  // namespace
}  // namespace cairn::icp
