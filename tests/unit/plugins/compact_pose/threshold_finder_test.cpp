// SPDX-License-Identifier: BSD-3-Clause
#include "threshold_finder.hpp"

#include <cmath>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "support/pose_world.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using test::Draw;
using test::planar_types;
using testing::HasSubstr;
using testing::Key;

TEST(Percentile, IsTheSmallestNumberThatAPartDoesNotExceed) {
  std::vector<double> numbers{7.0, 3.0, 10.0, 1.0, 2.0, 9.0, 4.0, 8.0, 6.0, 5.0};
  EXPECT_EQ(percentile(numbers, 0.9), 9.0);
  EXPECT_EQ(percentile(numbers, 0.91), 10.0);
  EXPECT_EQ(percentile(numbers, 0.5), 5.0);
  EXPECT_EQ(percentile(numbers, 0.0), 1.0);
  EXPECT_EQ(percentile(numbers, 1.0), 10.0);
  EXPECT_EQ(percentile({4.0}, 0.9), 4.0);
  EXPECT_EQ(percentile({}, 0.9), 0.0);
}

class ThresholdFinderTest : public testing::Test {
 protected:
  void note(double mean, double sigma, double angle, double gain, double covariance) {
    const Dimensions d{.translations = 2,
                       .rotations = 1,
                       .t_mean = {mean, 0.1 * mean},
                       .t_sigma = {sigma, sigma},
                       .r_mean = {angle},
                       .r_sigma = {1e-6}};
    noted_.push_back(d);
    finder_.note_loop(test_, d, gain, covariance * MatrixXd::Identity(3, 3));
  }
  double number(const std::string& name) const {
    return std::stod(finder_.found(range_.probability).at(name));
  }

  Registry registry_;
  RigidGroup group_{planar_types(registry_).pose};
  SensorRange range_{.translation = {1.0, 1.0, 1.0}, .rotation = 0.1, .probability = 0.5};
  DistanceTest test_{group_, range_};
  ThresholdFinder finder_;
  std::vector<Dimensions> noted_;
};

TEST_F(ThresholdFinderTest, FindsEveryOptionByHand) {
  for (int k = 1; k <= 10; ++k) {
    note(0.5 * k, 1e-6, 0.01 * k, k, k);
    finder_.note_pose(0.1 * k);
  }
  const OptionValues found = finder_.found(0.5);
  EXPECT_THAT(found,
              testing::UnorderedElementsAre(Key("range"), Key("angle"), Key("probability"),
                                            Key("loop_gain"), Key("pose_gain"), Key("sensor")));
  // Half of each is within just its mean: σ counts for nothing.
  EXPECT_NEAR(number("range"), 5.0, 1e-4);
  EXPECT_NEAR(number("angle"), 0.1, 1e-4);
  EXPECT_EQ(number("probability"), 0.5);
  EXPECT_NEAR(number("loop_gain"), std::pow(10.0, 1.36) - 1.0, 1e-6);  // l₉₀ = 9
  EXPECT_NEAR(number("pose_gain"), std::pow(1.9, 1.7) - 1.0, 1e-6);    // p₉₀ = 0.9
  EXPECT_EQ(found.at("sensor"), "6 0 0 6 0 6");  // of ten, the upper of the two in the middle
}

TEST_F(ThresholdFinderTest, EveryNotedLoopPassesWithWhatWasFound) {
  Draw draw(1);
  for (const double s : {0.02, 0.1, 0.5, 0.8, 0.95}) {
    range_.probability = s;
    noted_.clear();
    ThresholdFinder finder;
    const DistanceTest watching(group_, range_);
    for (int k = 0; k < 200; ++k) {
      const Dimensions d{.translations = 2,
                         .rotations = 1,
                         .t_mean = {draw.uniform(-9.0, 9.0), draw.uniform(-9.0, 9.0)},
                         .t_sigma = {draw.uniform(0.0, 3.0), draw.uniform(0.0, 3.0)},
                         .r_mean = {draw.uniform(-3.14, 3.14)},
                         .r_sigma = {draw.uniform(0.0, 3.0)}};
      noted_.push_back(d);
      finder.note_loop(watching, d, 1.0, MatrixXd::Identity(3, 3));
      const OptionValues found = finder.found(s);
      const double range = std::stod(found.at("range"));
      const DistanceTest test(group_, {.translation = {range, range, range},
                                       .rotation = std::stod(found.at("angle")),
                                       .probability = std::stod(found.at("probability"))});
      for (const Dimensions& noted : noted_) ASSERT_TRUE(test.passes(noted)) << "s " << s;
    }
  }
}

TEST_F(ThresholdFinderTest, WithoutALoopClosureItSaysSo) {
  finder_.note_pose(1.0);
  try {
    finder_.found(0.5);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    EXPECT_THAT(error.what(), HasSubstr("no loop closure"));
  }
}

TEST_F(ThresholdFinderTest, TheSensorIsWrittenByRowsOfItsUpperTriangle) {
  MatrixXd S(3, 3);
  S << 1.0, 0.125, 0.25, 0.125, 2.0, 0.5, 0.25, 0.5, 4.0;
  finder_.note_loop(test_, {.translations = 2, .rotations = 1}, 1.0, S);
  EXPECT_EQ(finder_.found(0.5).at("sensor"), "1 0.125 0.25 2 0.5 4");
}

TEST(MedianCovariance, IsTheMiddleOneByDeterminant) {
  const std::vector<Matrix> some{5.0 * MatrixXd::Identity(3, 3), MatrixXd::Identity(3, 3),
                                 2.0 * MatrixXd::Identity(3, 3)};
  EXPECT_EQ(median_covariance(some), some[2]);
  EXPECT_THROW(median_covariance({}), std::logic_error);
}

/// Of equals the first: a tie that rounding decides would make a map depend on the machine.
TEST(MedianCovariance, DoesNotDependOnRounding) {
  Matrix lever = MatrixXd::Identity(3, 3);
  lever(0, 2) = lever(2, 0) = 3.0;
  lever(0, 0) = 10.0;  // determinant 1
  const Matrix one = MatrixXd::Identity(3, 3);
  for (const double rounding : {1.0 - 1e-12, 1.0 + 1e-12}) {
    const std::vector<Matrix> two{one, lever * rounding, one};
    EXPECT_EQ(median_covariance(two), two[1]);
  }
}

TEST(TypicalMatch, IsTheMedianOfTheLatest) {
  TypicalMatch typical;
  EXPECT_FALSE(typical.known());
  typical.note(4.0 * MatrixXd::Identity(3, 3));
  EXPECT_TRUE(typical.known());
  EXPECT_EQ(typical.covariance()(0, 0), 4.0);
  for (int k = 0; k < 10; ++k) typical.note(MatrixXd::Identity(3, 3));
  EXPECT_EQ(typical.covariance()(0, 0), 1.0);
  typical.note(1e6 * MatrixXd::Identity(3, 3));  // one that failed counts for nothing
  EXPECT_EQ(typical.covariance()(0, 0), 1.0);
  for (int k = 0; k < 100; ++k) typical.note(9.0 * MatrixXd::Identity(3, 3));
  EXPECT_EQ(typical.covariance()(0, 0), 9.0);
}

TEST(TypicalMatch, ForgetsAFalseOne) {
  const auto match = [](int k) { return Matrix((1.0 + k) * MatrixXd::Identity(3, 3)); };
  for (const int count : {5, 31, 80}) {  // the ring is not full, full, and has gone round
    TypicalMatch all, without;
    for (int k = 0; k < count; ++k) all.note(match(k));
    // 30 and the one that is forgotten are left of those that came.
    for (int k = std::max(0, count - 31); k < count; ++k) {
      if (k != count - 4) without.note(match(k));
    }
    all.forget(match(count - 4));
    all.forget(match(count + 7));  // which never came
    for (int k = count; k < count + 40; ++k) {
      EXPECT_EQ(all.covariance(), without.covariance()) << count << " " << k;
      all.note(match(k));
      without.note(match(k));
    }
  }
  TypicalMatch one;
  one.note(match(1));
  one.forget(match(1));
  EXPECT_FALSE(one.known());
}

}  // namespace
}  // namespace cairn::compact
