// SPDX-License-Identifier: BSD-3-Clause
// The error metrics against independent definitions of them, by matrices.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <unsupported/Eigen/MatrixFunctions>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "support/sampling.hpp"

namespace cairn::test {
namespace {

using Residual = Eigen::Matrix<double, 6, 1>;

struct Edge {
  std::vector<double> a, b, z;
};

Eigen::Isometry3d isometry(const std::vector<double>& x) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(x[6], x[3], x[4], x[5]).toRotationMatrix();
  T.translation() << x[0], x[1], x[2];
  return T;
}

Residual residual(const std::string& metric, const Edge& edge) {
  Registry registry;
  registry.set_type_options(parse_component("slam3d:metric=" + metric));
  const auto type = registry.factor_type("EDGE_SE3:QUAT");
  EXPECT_EQ(type->metric(), metric);
  const double* x[] = {edge.a.data(), edge.b.data()};
  std::vector<double> unit;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) unit.push_back(row == column ? 1.0 : 0.0);
  }
  Residual r;
  type->evaluate(x, edge.z.data(), unit.data(), r.data(), nullptr);
  return r;
}

std::vector<Edge> edges() {
  Registry registry;
  const auto pose = registry.variable_type("VERTEX_SE3:QUAT");
  Sampler sampler(23);
  std::vector<Edge> all;
  for (int k = 0; k < 10; ++k) {
    const Regime any{"any", -1.0};
    all.push_back(
        {sampler.state(*pose, any), sampler.state(*pose, any), sampler.state(*pose, any)});
  }
  return all;
}

Eigen::Isometry3d error_of(const Edge& e) {
  return isometry(e.z).inverse() * (isometry(e.a).inverse() * isometry(e.b));
}

TEST(Metric, LogarithmIsTheLogarithmOfTheMatrix) {
  for (const Edge& e : edges()) {
    const Eigen::Matrix4d log = error_of(e).matrix().log();
    const Residual expected{{log(0, 3), log(1, 3), log(2, 3), log(2, 1), log(0, 2), log(1, 0)}};
    EXPECT_LT((residual("logarithm", e) - expected).norm(), 1e-10);
  }
}

TEST(Metric, G2oIsTranslationAndVectorPartOfTheQuaternion) {
  for (const Edge& e : edges()) {
    const Eigen::Isometry3d E = error_of(e);
    Eigen::Quaterniond q(E.linear());
    if (q.w() < 0) q.coeffs() *= -1;
    Residual expected;
    expected << E.translation(), q.vec();
    EXPECT_LT((residual("g2o", e) - expected).norm(), 1e-12);
  }
}

TEST(Metric, RotationVectorIsTranslationAndAngleTimesAxis) {
  for (const Edge& e : edges()) {
    const Eigen::Isometry3d E = error_of(e);
    const Eigen::AngleAxisd turn(E.linear());
    Residual expected;
    expected << E.translation(), turn.angle() * turn.axis();
    EXPECT_LT((residual("rotation_vector", e) - expected).norm(), 1e-10);
  }
}

TEST(Metric, IsTheSameForBothSignsOfAQuaternion) {
  for (const std::string metric : {"logarithm", "g2o", "rotation_vector"}) {
    for (Edge e : edges()) {
      const Residual expected = residual(metric, e);
      for (int k = 3; k < 7; ++k) e.b[k] = -e.b[k];
      EXPECT_LT((residual(metric, e) - expected).norm(), 1e-13) << metric;
    }
  }
}

TEST(Metric, IsRefusedWhereItIsNotOnOffer) {
  Registry registry;
  try {
    registry.set_type_options(parse_component("slam3d:metric=euler"));
    registry.factor_type("EDGE_SE3:QUAT");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("rotation_vector"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace cairn::test
