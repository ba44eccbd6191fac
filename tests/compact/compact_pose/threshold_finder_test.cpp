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
    finder_.note_loop(d, gain, covariance * MatrixXd::Identity(3, 3));
  }
  double number(const std::string& name) const { return std::stod(finder_.found(test_).at(name)); }

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
  const OptionValues found = finder_.found(test_);
  EXPECT_THAT(found, testing::UnorderedElementsAre(Key("range"), Key("angle"), Key("probability"),
                                                   Key("noise_scale"), Key("loop_gain"),
                                                   Key("pose_gain"), Key("sensor")));
  // Half of each is within just its mean: σ counts for nothing.
  EXPECT_NEAR(number("range"), 5.0, 1e-4);
  EXPECT_NEAR(number("angle"), 0.1, 1e-4);
  EXPECT_EQ(number("probability"), 0.5);
  EXPECT_EQ(number("noise_scale"), 1.0);
  EXPECT_NEAR(number("loop_gain"), std::pow(10.0, 1.36) - 1.0, 1e-6);  // l₉₀ = 9
  EXPECT_NEAR(number("pose_gain"), std::pow(1.9, 1.7) - 1.0, 1e-6);    // p₉₀ = 0.9
  EXPECT_EQ(found.at("sensor"), "6 0 0 6 0 6");  // of ten, the upper of the two in the middle
}

TEST_F(ThresholdFinderTest, EveryNotedLoopPassesWithWhatWasFound) {
  Draw draw(1);
  for (const double s : {0.02, 0.1, 0.5, 0.8, 0.95}) {
    range_.probability = s;
    range_.noise_scale = draw.uniform(0.1, 1.0);
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
      finder.note_loop(d, 1.0, MatrixXd::Identity(3, 3));
      const OptionValues found = finder.found(watching);
      const double range = std::stod(found.at("range"));
      const DistanceTest test(group_, {.translation = {range, range, range},
                                       .rotation = std::stod(found.at("angle")),
                                       .probability = std::stod(found.at("probability")),
                                       .noise_scale = std::stod(found.at("noise_scale"))});
      for (const Dimensions& noted : noted_) ASSERT_TRUE(test.passes(noted)) << "s " << s;
    }
  }
}

TEST_F(ThresholdFinderTest, WithoutALoopClosureItSaysSo) {
  finder_.note_pose(1.0);
  try {
    finder_.found(test_);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input);
    EXPECT_THAT(error.what(), HasSubstr("no loop closure"));
  }
}

TEST_F(ThresholdFinderTest, TheSensorIsWrittenByRowsOfItsUpperTriangle) {
  MatrixXd S(3, 3);
  S << 1.0, 0.125, 0.25, 0.125, 2.0, 0.5, 0.25, 0.5, 4.0;
  finder_.note_loop({.translations = 2, .rotations = 1}, 1.0, S);
  EXPECT_EQ(finder_.found(test_).at("sensor"), "1 0.125 0.25 2 0.5 4");
}

TEST(CovarianceBySize, IsThatOfAPartByDeterminant) {
  const std::vector<Matrix> some{5.0 * MatrixXd::Identity(3, 3), MatrixXd::Identity(3, 3),
                                 2.0 * MatrixXd::Identity(3, 3)};
  EXPECT_EQ(covariance_by_size(some, 0.5), some[2]);
  EXPECT_EQ(covariance_by_size(some, 0.25), some[1]);
  EXPECT_EQ(covariance_by_size(some, 0.7), some[0]);
  EXPECT_THROW(covariance_by_size({}, 0.5), std::logic_error);
}

/// Where errors are smaller than covariances say, uncertainty makes no range larger.
TEST_F(ThresholdFinderTest, CountsDeviationsAsTheyAre) {
  note(1.0, 10.0, 0.01, 1.0, 1.0);
  const double as_said = number("range");
  range_.noise_scale = 0.1;
  const DistanceTest scaled(group_, range_);
  EXPECT_NEAR(std::stod(finder_.found(scaled).at("range")), range_within(1.0, 1.0, 0.5), 1e-5);
  EXPECT_GT(as_said, 5.0);
}

/// Of equals the first: a tie that rounding decides would make a map depend on the machine.
TEST(CovarianceBySize, DoesNotDependOnRounding) {
  Matrix lever = MatrixXd::Identity(3, 3);
  lever(0, 2) = lever(2, 0) = 3.0;
  lever(0, 0) = 10.0;  // determinant 1
  const Matrix one = MatrixXd::Identity(3, 3);
  for (const double rounding : {1.0 - 1e-12, 1.0 + 1e-12}) {
    const std::vector<Matrix> two{one, lever * rounding, one};
    EXPECT_EQ(covariance_by_size(two, 0.5), two[1]);
  }
}

Matrix sized(double size) { return size * MatrixXd::Identity(3, 3); }

/// What a match can be worth, however many others are poor.
TEST(TypicalMatch, IsTheLowerQuartileOfTheLatest) {
  TypicalMatch typical;
  EXPECT_FALSE(typical.known());
  typical.note(sized(4.0));
  EXPECT_TRUE(typical.known());
  EXPECT_EQ(typical.covariance()(0, 0), 4.0);
  typical.note(sized(1.0));
  for (int k = 0; k < 2; ++k) typical.note(sized(1e6));  // those that failed count for nothing
  EXPECT_EQ(typical.covariance()(0, 0), 4.0);
  for (int k = 0; k < 100; ++k) typical.note(sized(k % 3 == 0 ? 2.0 : 9.0));
  EXPECT_EQ(typical.covariance()(0, 0), 2.0);
}

/// Poor matches that keep others from being asked for are forgotten, the poorer half first.
TEST(TypicalMatch, IsForgottenWhereItSilences) {
  TypicalMatch typical;
  for (int k = 1; k <= 4; ++k) typical.note(sized(k));
  const auto silence = [&](int poses) {
    for (int k = 0; k < poses; ++k) typical.note_silence();
  };
  silence(7);
  typical.note(sized(5.0));  // a match: the silence is over
  silence(7);
  EXPECT_EQ(typical.covariance()(0, 0), 2.0);
  silence(1);  // 1 and 2 are left
  EXPECT_EQ(typical.covariance()(0, 0), 1.0);
  silence(8);
  EXPECT_TRUE(typical.known());
  silence(8);
  EXPECT_FALSE(typical.known());
  silence(8);
  typical.note(sized(7.0));
  EXPECT_EQ(typical.covariance()(0, 0), 7.0);
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
