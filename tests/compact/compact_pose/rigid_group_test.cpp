// SPDX-License-Identifier: BSD-3-Clause
#include "rigid_group.hpp"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/lie/se2.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_variable.hpp"
#include "support/pose_world.hpp"
#include "support/scaled_pose.hpp"

namespace cairn::compact {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::difference;
using test::Draw;
using test::numerical_jacobian;
using test::PoseWorld;
using test::types_of;
using testing::HasSubstr;

class RigidGroupIn : public testing::TestWithParam<int> {
 protected:
  Registry registry;
  PoseWorld world{types_of(GetParam(), registry)};
  RigidGroup group{world.types().pose};
  int n = world.tangent();
  /// Also far from the identity.
  std::vector<double> pose(Draw& draw) const { return world.random(draw, 5.0, 1.7); }
};
INSTANTIATE_TEST_SUITE_P(PlaneAndSpace, RigidGroupIn, testing::Values(2, 3));

TEST_P(RigidGroupIn, IsTheTypesGroup) {
  Draw draw(1);
  EXPECT_EQ(group.dimension(), GetParam());
  EXPECT_EQ(group.tangent_size(), GetParam() == 2 ? 3 : 6);
  for (int trial = 0; trial < 20; ++trial) {
    const auto a = pose(draw), b = pose(draw);
    const State x = group.state(a), y = group.state(b);
    const auto expect = [&](const State& result, const std::vector<double>& expected) {
      EXPECT_LT(world.log(world.between(group.view(result), expected)).norm(), 1e-12);
    };
    expect(x, a);
    expect(group.compose(x, y), world.compose(a, b));
    expect(group.between(x, y), world.between(a, b));
    EXPECT_LT((VectorXd(group.log(x)) - world.log(a)).norm(), 1e-12);
    const PlacedState from = group.place(x), to = group.place(y);
    expect(from.x, a);
    expect(from.inverse, world.inverse(a));
    EXPECT_LT((from.at.R - world.split(a).first).norm(), 1e-12);
    EXPECT_LT((from.at.t - world.split(a).second).norm(), 1e-12);
    const Displacement d = group.displacement(from, to);
    expect(d.mean, world.between(a, b));
    const auto [R, t] = world.split(world.between(a, b));
    EXPECT_LT((d.at.R - R).norm(), 1e-12);
    EXPECT_LT((d.at.t - t).norm(), 1e-12);
    const cairn::Pose seen = RigidGroup::seen_from(from, to);
    EXPECT_LT((seen.R - R).norm(), 1e-12);
    EXPECT_LT((seen.t - t).norm(), 1e-12);
    const MatrixXd A = numerical_jacobian(n, [&](const VectorXd& step) {
      return world.log(world.compose(world.compose(world.inverse(a), world.exp(step)), a));
    });
    EXPECT_LT(difference(group.adjoint(group.inverse(x)), A), 1e-8);
  }
}

TEST_P(RigidGroupIn, CarriesTheJointCovarianceOfTwoPosesToTheirDisplacement) {
  Draw draw(2);
  for (int trial = 0; trial < 20; ++trial) {
    const auto a = pose(draw), b = pose(draw), ab = world.between(a, b);
    const MatrixXd joint = draw.covariance(2 * n, 0.3);
    const MatrixXd J = numerical_jacobian(2 * n, [&](const VectorXd& step) {
      return world.log(world.between(
          ab, world.between(world.moved(a, step.head(n)), world.moved(b, step.tail(n)))));
    });
    Displacement d = group.displacement(group.place(group.state(a)), group.place(group.state(b)));
    group.set_covariance(joint.topLeftCorner(n, n), joint.topRightCorner(n, n),
                         joint.bottomRightCorner(n, n), d);
    EXPECT_LT(difference(d.covariance, J * joint * J.transpose()), 1e-8);
    EXPECT_LT(difference(d.covariance, d.covariance.transpose()), 1e-14);
  }
}

TEST_P(RigidGroupIn, TwistsAreVelocitiesInTheBodysFrame) {
  Draw draw(3);
  const auto a = pose(draw);
  const MatrixXd Sigma = draw.covariance(n, 0.2);
  const auto [R, t] = world.split(a);
  const MatrixXd J = numerical_jacobian(n, [&, R = R, t = t](const VectorXd& step) {
    const auto [R_new, t_new] = world.split(world.moved(a, step));
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(R.transpose() * R_new));
    VectorXd twist(6);
    twist << R.transpose() * (t_new - t), turn.angle() * turn.axis();
    return twist;
  });
  const auto twist = group.twist_covariance(Sigma);
  EXPECT_LT(difference(twist, J * Sigma * J.transpose()), 1e-8);
  if (GetParam() == 2) {
    for (const int row : {2, 3, 4}) EXPECT_EQ(twist.row(row).norm() + twist.col(row).norm(), 0.0);
  }
}

TEST_P(RigidGroupIn, IsotropicCovariancesHaveTheSameDeviationAlongEveryAxis) {
  const auto twist = group.twist_covariance(group.isotropic(0.3, 0.02));
  Eigen::Matrix<double, 6, 1> expected;
  expected << 0.09, 0.09, 0.09, 4e-4, 4e-4, 4e-4;
  if (GetParam() == 2) expected[2] = expected[3] = expected[4] = 0.0;
  const MatrixXd diagonal = expected.asDiagonal();
  EXPECT_LT((twist - diagonal).norm(), 1e-14);
}

// Equation 22.
TEST_P(RigidGroupIn, MutualInformationIsHalfTheLogarithmOfTheDeterminants) {
  Draw draw(4);
  for (int trial = 0; trial < 20; ++trial) {
    const MatrixXd S_y = draw.covariance(n, 0.1), S_d = draw.covariance(n, 0.5);
    EXPECT_NEAR(mutual_information(S_y, S_d),
                0.5 * std::log((S_y + S_d).determinant() / S_y.determinant()), 1e-10);
    EXPECT_GT(mutual_information(S_y, S_d), mutual_information(2.0 * S_y, S_d));
    EXPECT_EQ(mutual_information(S_y, MatrixXd::Zero(n, n)), 0.0);
    EXPECT_EQ(mutual_information(S_y, -1e-18 * MatrixXd::Identity(n, n)), 0.0);
  }
  EXPECT_NEAR(mutual_information(group.isotropic(1.0, 2.0), group.isotropic(1.0, 2.0)),
              0.5 * n * std::log(2.0), 1e-12);
}

TEST(RigidGroup, RefusesATypeThatIsNoGroup) {
  EXPECT_THROW(RigidGroup{define_variable<test::ScaledPose>()}, Error);
}

/// The plane's poses, where a step forwards is composed in the world's frame.
struct Detached : Se2 {
  static constexpr std::string_view kTag = "VERTEX_DETACHED";
  template <class S>
  static cairn::Vector<S, 3> compose(const cairn::Vector<S, 3>& a, const cairn::Vector<S, 3>& b) {
    return {a[0] + b[0], a[1] + b[1], wrap_angle<S>(a[2] + b[2])};
  }
  template <class S>
  static cairn::Vector<S, 3> inverse(const cairn::Vector<S, 3>& a) {
    return -a;
  }
};

TEST(RigidGroup, RefusesAGroupOfPosesThatComposeInAnotherWay) {
  try {
    const RigidGroup group(define_variable<Detached>());
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), HasSubstr("VERTEX_DETACHED composes in another way"));
  }
}

TEST(RigidGroup, RefusesWhatHasNoOrientation) {
  Registry registry;
  for (const char* tag : {"VERTEX_XY", "VERTEX_TRACKXYZ"}) {
    const auto type = registry.variable_type(tag);
    try {
      const RigidGroup group(type);
      FAIL() << "no error for " << tag;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::usage);
      EXPECT_THAT(error.what(), HasSubstr(tag));
    }
  }
}

}  // namespace
}  // namespace cairn::compact
