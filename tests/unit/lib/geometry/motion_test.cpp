// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/geometry/motion.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/lie/point.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_variable.hpp"
#include "unit/lib/geometry/motions.hpp"

namespace cairn::test {
namespace {

using testing::HasSubstr;

INSTANTIATE_TEST_SUITE_P(Poses, MotionGroupTest, testing::Bool(), [](const auto& spatial) {
  return std::string(spatial.param ? "InSpace" : "InThePlane");
});

TEST_P(MotionGroupTest, LeavesAMotionAloneThatNothingIsComposedWith) {
  const Motion a = sampler_.motion(type_);
  for (const CompositionOrder order : {CompositionOrder::first, CompositionOrder::fourth}) {
    expect_same(group_, group_.compose(a, group_.identity(), order), a, 1e-14);
    expect_same(group_, group_.compose(group_.identity(), a, order), a, 1e-14);
  }
}

TEST_P(MotionGroupTest, ComposesInAnyGrouping) {
  const Motion a = sampler_.motion(type_), b = sampler_.motion(type_), c = sampler_.motion(type_);
  expect_same(group_, group_.compose(group_.compose(a, b), c),
              group_.compose(a, group_.compose(b, c)), 1e-13);
}

TEST_P(MotionGroupTest, TurnsBackAMotion) {
  const Motion a = sampler_.motion(type_), b = sampler_.motion(type_);
  EXPECT_LT(distance(group_, group_.compose(a, group_.inverse(a)).mean, group_.identity().mean),
            1e-14);
  expect_same(group_, group_.inverse(group_.inverse(a)), a, 1e-13);
  expect_same(group_, group_.inverse(group_.compose(a, b)),
              group_.compose(group_.inverse(b), group_.inverse(a)), 1e-13);
}

TEST_P(MotionGroupTest, GivesSymmetricCovariancesToTheLastBit) {
  const Motion a = sampler_.motion(type_, 0.7), b = sampler_.motion(type_, 0.7);
  for (const Motion& motion : {group_.compose(a, b), group_.compose(a, b, CompositionOrder::fourth),
                               group_.inverse(a), group_.fuse(a, {a.mean, b.covariance})})
    EXPECT_EQ(covariance(motion), covariance(motion).transpose());
}

TEST_P(MotionGroupTest, StaysInTheGroupOverManySteps) {
  Motion way = group_.identity();
  const Motion step{sampler_.state(type_), group_.identity().covariance};
  for (int k = 0; k < 20000; ++k) way = group_.compose(way, step);
  std::vector<double> canonical = way.mean;
  EXPECT_EQ(type_.normalize(canonical.data()), "");
  EXPECT_EQ(way.mean, canonical);
}

TEST(Fusing, IsTheWeightedMeanWhereMotionsAreAdded) {
  const MotionGroup group(define_variable<PointXY>());
  const Motion both =
      group.fuse({{1.0, 4.0}, {1.0, 0.0, 0.0, 1.0}}, {{4.0, 0.0}, {2.0, 0.0, 0.0, 1.0}});
  EXPECT_NEAR(both.mean[0], 2.0, 1e-15);
  EXPECT_NEAR(both.mean[1], 2.0, 1e-15);
  EXPECT_NEAR(both.covariance[0], 2.0 / 3.0, 1e-15);
  EXPECT_NEAR(both.covariance[1], 0.0, 1e-15);
  EXPECT_NEAR(both.covariance[3], 0.5, 1e-15);
}

TEST_P(MotionGroupTest, KnowsTwiceAsMuchFromTheSameMeasurementTwice) {
  const Motion a = sampler_.motion(type_);
  Motion half = a;
  for (double& x : half.covariance) x *= 0.5;
  expect_same(group_, group_.fuse(a, a), half, 1e-12);
}

TEST_P(MotionGroupTest, FusesInAnyOrderAndFromEitherEnd) {
  const Motion a = sampler_.motion(type_, 0.3);
  const Motion b{group_.compose(a, {sampler_.state(type_, 0.5), a.covariance}).mean,
                 numbers(sampler_.positive(n_, 0.3))};
  const Motion both = group_.fuse(a, b);
  EXPECT_GT(distance(group_, a.mean, both.mean), 0.02);
  EXPECT_GT(distance(group_, b.mean, both.mean), 0.02);
  expect_same(group_, group_.fuse(b, a), both, 1e-9);
  expect_same(group_, group_.inverse(group_.fuse(group_.inverse(a), group_.inverse(b))), both,
              1e-9);
}

TEST_P(MotionGroupTest, FusesNothingThatIsKnownExactly) {
  const Motion a = sampler_.motion(type_);
  try {
    group_.fuse(a, group_.identity());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::numerical);
    EXPECT_THAT(error.what(), HasSubstr("not positive definite"));
  }
}

}  // namespace
}  // namespace cairn::test
