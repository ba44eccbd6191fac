// SPDX-License-Identifier: BSD-3-Clause
#include "sampled_map_entropy.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr double kLogOdds = 3.0;

/// A map of one cell of 4 m²: known if the last scan was taken at x > 0, or, of several, at a
/// larger x than the first; else unknown.
class OneCell final : public Mapper {
 public:
  void add(const Pose2& at, LaserScan) override { poses_.push_back(at); }
  bool move(std::span<const Pose2> poses) override {
    poses_.assign(poses.begin(), poses.end());
    return true;
  }
  const FloorMap& map() override {
    map_.frame = {.width = 1, .height = 1, .resolution = 2.0};
    const double least = poses_.size() > 1 ? poses_.front().x() : 0.0;
    map_.log_odds = {poses_.back().x() > least ? static_cast<float>(kLogOdds) : 0.0F};
    map_.cells = {CellState::unknown};
    return map_;
  }
  void reset() override { poses_.clear(); }

 private:
  std::vector<Pose2> poses_;
  FloorMap map_;
};

/// What knowing that cell is worth.
double known_cell() {
  const double p = 1.0 / (1.0 + std::exp(-kLogOdds));
  return 4.0 * (-p * std::log(p) - (1.0 - p) * std::log(1.0 - p) - std::numbers::ln2);
}

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

TEST(SampledMapEntropy, IsThatOfTheMeanWhereNothingIsUncertain) {
  OneCell mapper;
  const PoseGaussian poses{{Pose2(0.3, 0.0, 0.0)}, Eigen::MatrixXd::Zero(3, 3)};
  const std::vector<AttachedScan> scans{{0, Pose2(), {}}};
  const SampledMapEntropy entropy = sampled_map_entropy(poses, scans, mapper, 5, 1);
  EXPECT_DOUBLE_EQ(entropy.at_mean, known_cell());
  EXPECT_DOUBLE_EQ(entropy.mean, known_cell());
  EXPECT_EQ(entropy.standard_error, 0.0);
}

TEST(SampledMapEntropy, IsTheExpectationOverTheSamples) {
  OneCell mapper;
  PoseGaussian poses{{Pose2(0.3, 0.0, 0.0)}, Eigen::MatrixXd::Zero(3, 3)};
  poses.covariance(0, 0) = 0.25;
  const std::vector<AttachedScan> scans{{0, Pose2(), {}}};
  const SampledMapEntropy entropy = sampled_map_entropy(poses, scans, mapper, 20000, 3);
  const double exact = normal_cdf(0.3 / 0.5) * known_cell();
  EXPECT_DOUBLE_EQ(entropy.at_mean, known_cell());
  EXPECT_NEAR(entropy.mean, exact, 4.0 * entropy.standard_error);
  EXPECT_NEAR(entropy.standard_error * std::sqrt(20000.0),
              std::abs(known_cell()) * std::sqrt(0.7257 * 0.2743), 0.02);
}

TEST(SampledMapEntropy, ScansStandAtTheirOffsetOnTheRightTangent) {
  // The pose looks along y: an error to its left moves it along −x, and its offset is along x.
  OneCell mapper;
  PoseGaussian poses{{Pose2(0.0, 0.0, std::numbers::pi / 2.0)}, Eigen::MatrixXd::Zero(3, 3)};
  poses.covariance(1, 1) = 0.04;
  poses.covariance(0, 0) = 100.0;
  const std::vector<AttachedScan> scans{{0, Pose2(0.0, -0.1, 0.0), {}}};
  const SampledMapEntropy entropy = sampled_map_entropy(poses, scans, mapper, 20000, 5);
  EXPECT_NEAR(entropy.mean, normal_cdf(0.1 / 0.2) * known_cell(), 4.0 * entropy.standard_error);
}

TEST(SampledMapEntropy, PosesAreSampledJointly) {
  // The second pose errs as the first one but for a little, which alone changes their order.
  OneCell mapper;
  PoseGaussian poses{{Pose2(0.0, 0.0, 0.0), Pose2(0.2, 0.0, 0.0)}, Eigen::MatrixXd::Zero(6, 6)};
  poses.covariance(0, 0) = 1.0;
  poses.covariance(0, 3) = poses.covariance(3, 0) = 1.0;
  poses.covariance(3, 3) = 1.0 + 0.09;
  const std::vector<AttachedScan> scans{{0, Pose2(), {}}, {1, Pose2(), {}}};
  const SampledMapEntropy entropy = sampled_map_entropy(poses, scans, mapper, 20000, 7);
  EXPECT_NEAR(entropy.mean, normal_cdf(0.2 / 0.3) * known_cell(), 4.0 * entropy.standard_error);
}

TEST(SampledMapEntropy, PosesThatComeLaterChangeNoEarlierSample) {
  OneCell mapper;
  PoseGaussian one{{Pose2(0.1, 0.0, 0.0)}, Eigen::MatrixXd::Identity(3, 3)};
  PoseGaussian two = one;
  two.mean.emplace_back(5.0, 0.0, 0.0);
  two.covariance = Eigen::MatrixXd::Identity(6, 6);
  two.covariance(0, 4) = two.covariance(4, 0) = 0.5;
  const std::vector<AttachedScan> scans{{0, Pose2(), {}}};
  EXPECT_EQ(sampled_map_entropy(one, scans, mapper, 50, 9).mean,
            sampled_map_entropy(two, scans, mapper, 50, 9).mean);
}

TEST(SampledMapEntropy, RefusesWhatIsNoCovariance) {
  OneCell mapper;
  const std::vector<AttachedScan> scans{{0, Pose2(), {}}};
  PoseGaussian poses{{Pose2()}, Eigen::MatrixXd::Identity(3, 3)};
  EXPECT_THROW(sampled_map_entropy(poses, scans, mapper, 1, 1), Error);
  poses.covariance(0, 1) = poses.covariance(1, 0) = 2.0;
  EXPECT_THROW(sampled_map_entropy(poses, scans, mapper, 10, 1), Error);
  poses.covariance = Eigen::MatrixXd::Constant(3, 3, std::numeric_limits<double>::quiet_NaN());
  EXPECT_THROW(sampled_map_entropy(poses, scans, mapper, 10, 1), Error);
  poses.covariance = Eigen::MatrixXd::Identity(6, 6);
  EXPECT_THROW(sampled_map_entropy(poses, scans, mapper, 10, 1), Error);
  poses.covariance = Eigen::MatrixXd::Identity(3, 3);
  const std::vector<AttachedScan> nowhere{{1, Pose2(), {}}};
  EXPECT_THROW(sampled_map_entropy(poses, nowhere, mapper, 10, 1), Error);
}

}  // namespace
}  // namespace cairn
