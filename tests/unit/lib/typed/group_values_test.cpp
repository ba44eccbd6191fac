// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>
#include <unsupported/Eigen/MatrixFunctions>

#include "cairn/pack/dual.hpp"
#include "cairn/typed/pose2.hpp"
#include "cairn/typed/pose3.hpp"
#include "cairn/typed/rot2.hpp"
#include "cairn/typed/rot3.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

constexpr double kPi = std::numbers::pi;

// The generator of each group as a homogeneous matrix: exp(δ) is the matrix exponential of it.
Eigen::Matrix2d generator(const Rot2&, const Vector<double, 1>& delta) {
  Eigen::Matrix2d W;
  W << 0, -delta[0], delta[0], 0;
  return W;
}
Eigen::Matrix3d generator(const Rot3&, const Vector<double, 3>& delta) {
  return so3::hat<double>(delta);
}
Eigen::Matrix3d generator(const Pose2&, const Vector<double, 3>& delta) {
  Eigen::Matrix3d W;
  W << 0, -delta[2], delta[0], delta[2], 0, delta[1], 0, 0, 0;
  return W;
}
Eigen::Matrix4d generator(const Pose3&, const Vector<double, 6>& delta) {
  Eigen::Matrix4d W = Eigen::Matrix4d::Zero();
  W.topLeftCorner<3, 3>() = so3::hat<double>(delta.tail<3>());
  W.topRightCorner<3, 1>() = delta.head<3>();
  return W;
}

/// Identity, tiny steps, random ones: rotations below π, so that the logarithm is unique.
template <class G>
struct Samples {
  static constexpr int kTangent = G::kTangent;
  static constexpr int kRotation = kTangent == 1 || std::is_same_v<G, Pose2> ? 1 : 3;

  template <class Check>
  static void each(Check check) {
    Sampler sampler(11);
    for (const Regime& regime :
         {Regime{"identity", 0.0, 0.0}, Regime{"tiny", 1e-8, 1e-8}, Regime{"random", -1.0, 2.0}}) {
      SCOPED_TRACE(regime.name);
      for (int k = 0; k < 30; ++k) check(tangent(sampler, regime));
    }
  }
  static Vector<double, kTangent> tangent(Sampler& sampler, const Regime& regime) {
    Vector<double, kTangent> delta;
    const auto moved = sampler.vector(kTangent - kRotation, regime.distance);
    const auto turned =
        sampler.direction(kRotation, regime.angle < 0 ? sampler.uniform(0.0, 3.0) : regime.angle);
    for (int k = 0; k < kTangent - kRotation; ++k) delta[k] = moved[k];
    for (int k = 0; k < kRotation; ++k) delta[kTangent - kRotation + k] = turned[k];
    return delta;
  }
  static G any(Sampler& sampler) { return G::exp(tangent(sampler, {"random", -1.0, 2.0})); }
};

template <class G>
class GroupValues : public ::testing::Test {};
using Groups = ::testing::Types<Rot2, Rot3, Pose2, Pose3>;
TYPED_TEST_SUITE(GroupValues, Groups);

TYPED_TEST(GroupValues, HaveTheExponentialOfTheMatrix) {
  Samples<TypeParam>::each([](const auto& delta) {
    const auto expected = generator(TypeParam(), delta).exp().eval();
    EXPECT_LT((TypeParam::exp(delta).matrix() - expected).norm(), 1e-13);
  });
}

TYPED_TEST(GroupValues, ComeBackFromTheirLogarithm) {
  Samples<TypeParam>::each([](const auto& delta) {
    EXPECT_LT((TypeParam::exp(delta).log() - delta).norm(), 1e-13 * (1.0 + delta.norm()));
  });
}

TYPED_TEST(GroupValues, ComposeAsTheirMatricesDo) {
  Sampler sampler(12);
  Samples<TypeParam>::each([&](const auto& delta) {
    const TypeParam a = TypeParam::exp(delta), b = Samples<TypeParam>::any(sampler),
                    c = Samples<TypeParam>::any(sampler);
    EXPECT_LT(((a * b).matrix() - a.matrix() * b.matrix()).norm(), 1e-13);
    EXPECT_LT((a.inverse().matrix() - a.matrix().inverse()).norm(), 1e-13);
    EXPECT_LT((a.between(b).matrix() - a.matrix().inverse() * b.matrix()).norm(), 1e-13);
    EXPECT_TRUE(((a * b) * c).equals(a * (b * c), 1e-13));
    EXPECT_TRUE((a * TypeParam::identity()).equals(a, 1e-15));
    EXPECT_TRUE((TypeParam::identity() * a).equals(a, 1e-15));
    EXPECT_TRUE((a * a.inverse()).equals(TypeParam(), 1e-14));
    EXPECT_TRUE((a * a.between(b)).equals(b, 1e-13));
  });
}

TYPED_TEST(GroupValues, AreTheStaticFunctionsOfTheirTypeOnTheSameNumbers) {
  using Traits = typename TypeParam::Traits;
  Sampler sampler(13);
  Samples<TypeParam>::each([&](const auto& delta) {
    const TypeParam a = TypeParam::exp(delta), b = Samples<TypeParam>::any(sampler);
    EXPECT_EQ(a.state(), Traits::template exp<double>(delta));
    EXPECT_EQ(a.inverse().state(), Traits::template inverse<double>(a.state()));
    EXPECT_EQ(a.between(b).state(), Traits::template between<double>(a.state(), b.state()));
    EXPECT_EQ(b.retract(delta).state(), Traits::template retract<double>(b.state(), delta));
    EXPECT_EQ(a.local(b), Traits::template local<double>(a.state(), b.state()));
    // But for the last bits of a quaternion, which the value normalizes.
    EXPECT_LT(((a * b).state() - Traits::template compose<double>(a.state(), b.state())).norm(),
              1e-15 * (1.0 + (a * b).state().norm()));
  });
}

TYPED_TEST(GroupValues, RetractAndLocalAreInverse) {
  Sampler sampler(14);
  Samples<TypeParam>::each([&](const auto& delta) {
    const TypeParam x = Samples<TypeParam>::any(sampler);
    EXPECT_LT((x.local(x.retract(delta)) - delta).norm(), 1e-13 * (1.0 + delta.norm()));
    EXPECT_TRUE(x.retract(delta).equals(x * TypeParam::exp(delta), 1e-13));
  });
}

TYPED_TEST(GroupValues, TheAdjointMovesAStepToTheOtherSide) {
  Sampler sampler(15);
  Samples<TypeParam>::each([&](const auto& delta) {
    const TypeParam x = Samples<TypeParam>::any(sampler);
    const typename TypeParam::Tangent moved = x.adjoint() * delta;
    EXPECT_LT(((x * TypeParam::exp(delta) * x.inverse()).matrix() - TypeParam::exp(moved).matrix())
                  .norm(),
              1e-13 * (1.0 + moved.norm()));
  });
}

TYPED_TEST(GroupValues, DifferentiateAsDualNumbers) {
  constexpr int N = TypeParam::kTangent;
  using Lifted = typename TypeParam::template Over<Dual<N>>;
  Sampler sampler(16);
  const TypeParam x = Samples<TypeParam>::any(sampler), y = Samples<TypeParam>::any(sampler);
  typename Lifted::Tangent step;
  for (int k = 0; k < N; ++k) step[k] = Dual<N>::variable(0.0, k);
  const auto apart =
      x.template cast<Dual<N>>().between(y.template cast<Dual<N>>() * Lifted::exp(step));
  for (int k = 0; k < N; ++k) {
    typename TypeParam::Tangent h = TypeParam::Tangent::Zero();
    h[k] = 1e-6;
    const typename TypeParam::State difference =
        (x.between(y.retract(h)).state() - x.between(y.retract(-h)).state()) / 2e-6;
    for (int row = 0; row < TypeParam::kAmbient; ++row)
      EXPECT_NEAR(apart.state()[row].gradient[k], difference[row], 1e-8);
  }
}

TYPED_TEST(GroupValues, AreSpansOfTheirState) {
  Sampler sampler(17);
  const TypeParam x = Samples<TypeParam>::any(sampler);
  const std::span<const double> numbers = x;
  ASSERT_EQ(numbers.size(), static_cast<std::size_t>(TypeParam::kAmbient));
  EXPECT_EQ(numbers.data(), x.state().data());
  EXPECT_EQ(TypeParam::from_state(numbers).state(), x.state());
  EXPECT_THROW(TypeParam::from_state(std::array<double, 9>{}), Error);
}

TEST(Pose2, IsWrappedAndMovesPoints) {
  const Pose2 pose(1.0, 2.0, 2.5 * kPi);
  EXPECT_NEAR(pose.theta(), kPi / 2, 1e-15);
  EXPECT_TRUE((pose * Point2(3.0, 1.0)).equals(Point2(0.0, 5.0), 1e-14));
  EXPECT_TRUE(pose.transform_to(pose.transform_from(Point2(3.0, 1.0))).equals(Point2(3.0, 1.0)));
  EXPECT_TRUE(Pose2(pose.rotation(), pose.translation()).equals(pose, 0.0));
  EXPECT_TRUE((pose.rotation() * pose.rotation().unrotate({1.0, 2.0})).equals({1.0, 2.0}, 1e-15));
}

TEST(Pose3, MovesPointsAsItsMatrixDoes) {
  const Pose3 pose(Rot3::roll_pitch_yaw(0.1, -0.2, 0.3), {1.0, 2.0, 3.0});
  const Point3 p(0.5, -1.0, 2.0);
  const Eigen::Vector4d expected = pose.matrix() * Eigen::Vector4d(p[0], p[1], p[2], 1.0);
  EXPECT_LT((pose * p - expected.head<3>()).norm(), 1e-15);
  EXPECT_TRUE(pose.transform_to(pose * p).equals(p, 1e-14));
  EXPECT_TRUE(Pose3(pose.matrix()).equals(pose, 1e-14));
  EXPECT_TRUE(Pose3(pose.rotation(), pose.translation()).equals(pose, 0.0));
}

TEST(Rot3, ComesFromAnglesQuaternionsAndMatrices) {
  const Rot3 R = Rot3::roll_pitch_yaw(0.1, -0.2, 0.3);
  EXPECT_LT((R.roll_pitch_yaw() - Eigen::Vector3d(0.1, -0.2, 0.3)).norm(), 1e-15);
  EXPECT_TRUE(Rot3(R.matrix()).equals(R, 1e-15));
  // A quaternion may be of any length and sign.
  EXPECT_TRUE(Rot3(Eigen::Quaterniond(-3.0 * R.quaternion().coeffs())).equals(R, 1e-15));
  EXPECT_GT(Rot3(Eigen::Quaterniond(-0.8, 0.6, 0.0, 0.0)).quaternion().w(), 0.0);
  EXPECT_THROW(Rot3(Eigen::Quaterniond(0.0, 0.0, 0.0, 0.0)), Error);
  EXPECT_THROW(Rot3(Eigen::Quaterniond(std::numeric_limits<double>::quiet_NaN(), 0, 0, 1)), Error);
  EXPECT_TRUE((Rot3::yaw(kPi / 2) * Point3(1, 0, 0)).equals({0, 1, 0}, 1e-15));
}

TEST(Rot3, StaysARotationOverALongChain) {
  const Rot3 step = Rot3::roll_pitch_yaw(0.1, 0.2, 0.3);
  Rot3 R;
  for (int k = 0; k < 100000; ++k) R = R * step;
  EXPECT_NEAR(R.state().norm(), 1.0, 1e-15);
}

TEST(Equals, HoldsWithinTheTolerance) {
  EXPECT_TRUE(Pose2(1, 2, kPi).equals(Pose2(1, 2, -kPi)));
  EXPECT_TRUE(Pose2(1, 2, 3).equals(Pose2(1.001, 2, 3), 1.1e-3));
  EXPECT_FALSE(Pose2(1, 2, 3).equals(Pose2(1.001, 2, 3), 0.9e-3));
  EXPECT_FALSE(Point3(1, 2, 3).equals({1, 2, 3.1}, 0.05));
}

TEST(Values, AreWrittenAsTheyAreConstructed) {
  std::ostringstream text;
  text << Pose2(4.0, -0.0, 0.5) << ' ' << Point2(1.5, 2.0) << ' ' << Rot2(0.25);
  EXPECT_EQ(text.str(), "Pose2(4, 0, 0.5) Point2(1.5, 2) Rot2(0.25)");
  EXPECT_EQ(to_string(Pose3(Rot3::yaw(0.5), {1, 2, 3})), "Pose3(1, 2, 3; 0, 0, 0.5)");
  EXPECT_EQ(to_string(Rot3::yaw(0.5)), "Rot3(0, 0, 0.5)");
  EXPECT_EQ(to_string(Point3()), "Point3(0, 0, 0)");
}

TEST(Point2, ComputesAsAVector) {
  const Point2 a(1.0, 2.0), b(3.0, 5.0);
  const Point2 middle = 0.5 * (a + b);
  EXPECT_TRUE(middle.equals({2.0, 3.5}));
  EXPECT_DOUBLE_EQ((b - a).norm(), std::sqrt(13.0));
  const std::span<const double> numbers = a;
  EXPECT_EQ(numbers.data(), a.data());
  EXPECT_EQ(numbers.size(), 2U);
}

}  // namespace
}  // namespace cairn::test
