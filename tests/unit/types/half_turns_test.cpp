// SPDX-License-Identifier: BSD-3-Clause
// Headings of exactly ±π, and rotations of exactly half a turn, where a rotation has two logarithms
// and two quaternions.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Core>

#include "cairn/lie/se3.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

constexpr double kPi = std::numbers::pi;
using State = std::vector<double>;

/// Axes of rotation, some of them with zeros and of both signs.
const std::vector<Eigen::Vector3d>& axes() {
  static const std::vector<Eigen::Vector3d> all{
      {1, 0, 0},          {0, 1, 0},      {0, 0, 1},
      {-1, 0, 0},         {0, -1, 0},     {0, 0, -1},
      {0.6, 0.8, 0},      {0, -0.6, 0.8}, {2.0 / 3, -1.0 / 3, 2.0 / 3},
      {-0.48, 0.64, -0.6}};
  return all;
}

/// x y z and the quaternion of half a turn; w is 0 or −0.
State half_turn(const Eigen::Vector3d& axis, double w = 0.0) {
  return {1.0, -2.0, 3.0, axis[0], axis[1], axis[2], w};
}

struct Evaluated {
  Eigen::VectorXd r;
  std::vector<Eigen::MatrixXd> J;
  bool finite() const {
    bool all = r.allFinite();
    for (const auto& block : J) all = all && block.allFinite();
    return all;
  }
};

Evaluated evaluate(const FactorType& type, const std::vector<const double*>& x, const State& z) {
  const int n = type.residual_size();
  std::vector<double> unit;
  for (int row = 0; row < n; ++row) {
    unit.push_back(1.0);
    unit.insert(unit.end(), static_cast<std::size_t>(n - row - 1), 0.0);
  }
  Evaluated result{Eigen::VectorXd(n), {}};
  std::vector<double*> pointers;
  for (int v = 0; v < type.arity(); ++v) result.J.emplace_back(n, type.tangent_size(v));
  for (auto& block : result.J) pointers.push_back(block.data());
  type.evaluate(x.data(), z.data(), unit.data(), result.r.data(), pointers.data());
  return result;
}

TEST(HalfTurns, HeadingsOfPlusAndMinusPiAreTheSame) {
  CAIRN_NEEDS("types", "slam2d");
  Registry registry;
  const auto type = registry.factor_type("EDGE_SE2");
  const auto prior = registry.factor_type("EDGE_PRIOR_SE2");
  for (const double a : {kPi, -kPi}) {
    for (const double b : {kPi, -kPi}) {
      const State x{3.0, 4.0, a}, y{2.0, 4.0, b};
      // Ahead of x is where the abscissa falls.
      const Evaluated same = evaluate(*type, {x.data(), y.data()}, {1.0, 0.0, 0.0});
      EXPECT_LT(same.r.norm(), 1e-15) << a << ", " << b;
      EXPECT_TRUE(same.finite());
      EXPECT_LT(evaluate(*prior, {x.data()}, {3.0, 4.0, b}).r.norm(), 1e-15);

      const State straight{3.0, 4.0, 0.0};
      const Evaluated turned = evaluate(*type, {straight.data(), y.data()}, {-1.0, 0.0, a});
      EXPECT_LT(turned.r.norm(), 1e-15) << a << ", " << b;
    }
  }
}

TEST(HalfTurns, OfTheErrorLeavesPlanarJacobiansAsTheyAreBeside) {
  CAIRN_NEEDS("types", "slam2d");
  Registry registry;
  const auto type = registry.factor_type("EDGE_SE2");
  const State x{0.5, -1.0, 0.7}, z{1.0, 0.3, 0.2};
  for (const double turn : {kPi, -kPi}) {
    const State y{1.0, 1.0, 0.9 + turn}, beside{1.0, 1.0, 0.9 + turn * (1.0 - 1e-9)};
    const Evaluated at = evaluate(*type, {x.data(), y.data()}, z);
    const Evaluated near = evaluate(*type, {x.data(), beside.data()}, z);
    ASSERT_TRUE(at.finite());
    EXPECT_NEAR(std::abs(at.r[2]), kPi, 1e-15);
    for (int v = 0; v < 2; ++v) EXPECT_LT((at.J[v] - near.J[v]).norm(), 1e-8);
  }
}

TEST(HalfTurns, InSpaceAreTheirOwnInverses) {
  for (const Eigen::Vector3d& axis : axes()) {
    for (const double w : {0.0, -0.0}) {
      const State x = half_turn(axis, w);
      const Eigen::Map<const Vector<double, 7>> pose(x.data());
      const auto delta = Se3::log<double>(pose);
      EXPECT_TRUE(delta.allFinite());
      EXPECT_NEAR(delta.tail<3>().norm(), kPi, 1e-15);
      EXPECT_LT((delta.tail<3>() - kPi * axis).norm() * (delta.tail<3>() + kPi * axis).norm(),
                1e-13);
      const auto back = Se3::exp<double>(delta);
      EXPECT_LT((back.head<3>() - pose.head<3>()).norm(), 1e-14);
      EXPECT_NEAR(std::abs(back.tail<4>().dot(pose.tail<4>())), 1.0, 1e-15);
      const auto twice = Se3::compose<double>(pose, pose);
      EXPECT_NEAR(std::abs(twice[6]), 1.0, 1e-15);
    }
  }
}

/// Evaluates an error of exactly half a turn in each metric.
void expect_finite_errors(const std::string& metric) {
  Registry registry;
  registry.set_type_options(parse_component("slam3d:metric=" + metric));
  const auto between = registry.factor_type("EDGE_SE3:QUAT");
  const auto prior = registry.factor_type("EDGE_PRIOR_SE3:QUAT");
  const State start{0.5, 0.0, -1.0, 0, 0, 0, 1}, none{0, 0, 0, 0, 0, 0, 1};
  for (const Eigen::Vector3d& axis : axes()) {
    for (const double w : {0.0, -0.0}) {
      const State x = half_turn(axis, w);
      const Evaluated error = evaluate(*between, {start.data(), x.data()}, none);
      EXPECT_TRUE(error.finite()) << metric << ", axis " << axis.transpose();
      EXPECT_GT(error.r.tail<3>().norm(), 0.99);
      EXPECT_TRUE(evaluate(*prior, {x.data()}, none).finite());
      // A state and a measurement of half a turn, and no error.
      EXPECT_LT(evaluate(*prior, {x.data()}, half_turn(axis, -w)).r.norm(), 1e-14);
      EXPECT_LT(evaluate(*between, {none.data(), x.data()}, half_turn(axis, -w)).r.norm(), 1e-14);
      EXPECT_LT(evaluate(*between, {x.data(), none.data()},
                         [&] {
                           const auto inverse =
                               Se3::inverse<double>(Eigen::Map<const Vector<double, 7>>(x.data()));
                           return State(inverse.begin(), inverse.end());
                         }())
                    .r.norm(),
                1e-14);
    }
  }
}

TEST(HalfTurns, OfTheErrorInSpaceAreFiniteInEveryMetric) {
  CAIRN_NEEDS("types", "slam3d");
  for (const char* metric : {"logarithm", "g2o", "rotation_vector"}) expect_finite_errors(metric);
}

TEST(HalfTurns, TheSignOfAQuaternionMeansNothing) {
  CAIRN_NEEDS("types", "slam3d");
  Registry registry;
  const auto type = registry.factor_type("EDGE_SE3:QUAT");
  const State a{1, 2, 3, 0.5, -0.5, 0.5, 0.5}, z{0.3, 0.1, -0.2, 0.6, 0.0, 0.8, 0.0};
  const State b{2, 1, 0, -0.1, 0.7, 0.1, 0.7};
  const auto negative = [](State x) {
    for (std::size_t k = 3; k < 7; ++k) x[k] = -x[k];
    return x;
  };
  const Evaluated plain = evaluate(*type, {a.data(), b.data()}, z);
  const State minus_a = negative(a), minus_b = negative(b);
  for (const State* first : {&a, &minus_a}) {
    for (const State* second : {&b, &minus_b}) {
      for (const State& measured : {z, negative(z)}) {
        const Evaluated again = evaluate(*type, {first->data(), second->data()}, measured);
        EXPECT_LT((again.r - plain.r).norm(), 1e-14);
        for (int v = 0; v < 2; ++v) EXPECT_LT((again.J[v] - plain.J[v]).norm(), 1e-13);
      }
    }
  }
}

}  // namespace
}  // namespace cairn::test
