// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/planning/point_buckets.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "support/pose_world.hpp"

namespace cairn {
namespace {

using Eigen::Vector2d;

TEST(PointBuckets, FindWhatComparisonWithEveryPointFinds) {
  test::Draw draw(11);
  for (const double side : {0.1, 0.7, 20.0}) {
    PointBuckets buckets({-5.0, 2.0}, {5.0, 5.0}, side);
    std::vector<Vector2d> points;
    EXPECT_EQ(buckets.nearest({0.0, 3.0}), -1);
    std::vector<int> found;
    for (int n = 0; n < 400; ++n) {
      // In a corner at first, so that the nearest one may be many buckets away.
      points.emplace_back(draw.uniform(-5.0, n < 200 ? -4.0 : 5.0), draw.uniform(2.0, 5.0));
      buckets.add(points.back());
      const Vector2d at(draw.uniform(-5.0, 5.0), draw.uniform(2.0, 5.0));
      const auto apart = [&](const Vector2d& point) { return (point - at).squaredNorm(); };
      const auto nearest = std::ranges::min_element(points, {}, apart);
      ASSERT_EQ(buckets.nearest(at), nearest - points.begin());
      const double distance = draw.uniform(0.0, 3.0);
      buckets.within(at, distance, found);
      std::vector<int> expected;
      for (int k = 0; k <= n; ++k) {
        if (apart(points[std::size_t(k)]) <= distance * distance) expected.push_back(k);
      }
      ASSERT_EQ(found, expected);
    }
  }
}

}  // namespace
}  // namespace cairn
