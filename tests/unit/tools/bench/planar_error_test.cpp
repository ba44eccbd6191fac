// SPDX-License-Identifier: BSD-3-Clause
#include "planar_error.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace cairn::performance {
namespace {

TEST(PlanarError, IsWhatARigidMotionLeaves) {
  const PlanarPose moved{3.0, -2.0, 1.2};
  std::vector<PlanarPose> truth, estimate;
  for (int k = 0; k < 8; ++k) {
    truth.push_back({std::cos(0.7 * k), 2.0 * std::sin(0.4 * k), 0.3 * k});
    estimate.push_back(compose(moved, truth.back()));
  }
  EXPECT_NEAR(planar_error(estimate, truth).translation, 0.0, 1e-12);
  EXPECT_NEAR(planar_error(estimate, truth).rotation, 0.0, 1e-12);
  for (PlanarPose& pose : estimate) pose.theta += 0.1;
  EXPECT_NEAR(planar_error(estimate, truth).translation, 0.0, 1e-12);
  EXPECT_NEAR(planar_error(estimate, truth).rotation, 0.1, 1e-12);
}

/// No rotation beside the one that is found is better.
TEST(PlanarError, IsTheLeast) {
  const std::vector<PlanarPose> truth{{0, 0, 0}, {1, 0, 0}, {1, 2, 0}, {-1, 1, 0}};
  const std::vector<PlanarPose> estimate{{0.1, 0, 0}, {0.9, 0.2, 0}, {1.3, 2, 0}, {-1, 0.7, 0}};
  const double least = planar_error(estimate, truth).translation;
  double best = 1e9;
  for (int k = -3000; k <= 3000; ++k) {
    const PlanarPose turn{0.0, 0.0, 1e-4 * k};
    PlanarPose mean;
    std::vector<PlanarPose> errors;
    for (std::size_t j = 0; j < truth.size(); ++j) {
      const PlanarPose at = compose(turn, estimate[j]);
      errors.push_back({at.x - truth[j].x, at.y - truth[j].y, 0.0});
      mean.x += errors.back().x / 4.0;
      mean.y += errors.back().y / 4.0;
    }
    double sum = 0.0;
    for (const PlanarPose& error : errors)
      sum += std::pow(error.x - mean.x, 2) + std::pow(error.y - mean.y, 2);
    best = std::min(best, std::sqrt(sum / 4.0));
  }
  EXPECT_NEAR(least, best, 1e-6);
  EXPECT_LE(least, best);
}

TEST(PlanarError, OfNothingIsNone) { EXPECT_TRUE(std::isnan(planar_error({}, {}).translation)); }

}  // namespace
}  // namespace cairn::performance
