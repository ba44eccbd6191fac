// SPDX-License-Identifier: BSD-3-Clause
// Factors on variables with far more unknowns than a pose has.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/types/define_factor.hpp"
#include "support/block_systems.hpp"

namespace cairn::test {
namespace {

constexpr int kWaves = 121;

/// The coefficients of a function of one number, such as a calibration or a terrain.
struct Waves : Point<kWaves> {
  static constexpr std::string_view kTag = "VERTEX_WAVES";
};

template <class S>
Vector<S, kWaves> waves_at(const S& u) {
  using std::cos;
  Vector<S, kWaves> a;
  for (int k = 0; k < kWaves; ++k) a[k] = cos(0.1 * k * u);
  return a;
}

/// The value v of the function at u, seen with an offset: z = (u, v).
struct Sample {
  static constexpr std::string_view kTag = "EDGE_SAMPLE";
  static constexpr int kResidual = 1, kMeasurement = 2;
  using Variables = std::tuple<PointXY, Waves>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& offset, const Vector<S, kWaves>& x,
                               const Measured<S, 2>& z) {
    S sum = offset[0] + offset[1] * z[0] - z[1];
    for (int k = 0; k < kWaves; ++k) {
      using std::cos;
      sum += cos(0.1 * k * z[0]) * x[k];
    }
    return Vector<S, 1>(sum);
  }
};

/// All coefficients at once.
struct Coefficients {
  static constexpr std::string_view kTag = "EDGE_COEFFICIENTS";
  static constexpr int kResidual = kWaves, kMeasurement = kWaves;
  using Variables = std::tuple<Waves>;
  static Vector<double, kWaves> evaluate(const Vector<double, kWaves>& x,
                                         const Vector<double, kWaves>& z,
                                         Eigen::Matrix<double, kWaves, kWaves>& J) {
    J.setIdentity();
    return x - z;
  }
  template <class S>
  static Vector<S, kWaves> residual(const Vector<S, kWaves>& x, const Vector<double, kWaves>& z) {
    return x - z.template cast<S>();
  }
};

TEST(WideFactors, AddUpAsInDenseAlgebra) {
  Graph graph;
  const auto offset_type = define_variable<PointXY>();
  const auto waves_type = define_variable<Waves>();
  const auto sample_type = define_factor<Sample>();
  const auto coefficients_type = define_factor<Coefficients>();
  Eigen::VectorXd x(kWaves), offset(2);
  for (int k = 0; k < kWaves; ++k) x[k] = std::sin(1.0 + k);
  offset << 0.3, -0.2;
  const int a = graph.add_variable(waves_type, 0, {x.data(), kWaves});
  const int b = graph.add_variable(offset_type, 1, {offset.data(), 2});
  const int both[] = {b, a};

  constexpr int kSize = kWaves + 2;  // the waves first
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(kSize, kSize);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(kSize);
  double chi2 = 0.0;
  for (int n = 0; n < 37; ++n) {
    const double u = 0.7 * n, v = std::cos(n), information = 1.0 + n;
    const double z[] = {u, v};
    graph.add_factor(sample_type, both, z, {&information, 1});
    Eigen::VectorXd J(kSize);
    J << waves_at(u), 1.0, u;
    const double r = J.head(kWaves).dot(x) + offset[0] + offset[1] * u - v;
    H += information * J * J.transpose();
    g -= information * r * J;
    chi2 += information * r * r;
  }
  Eigen::VectorXd z = x.array() + 0.1;
  std::vector<double> information;  // the upper triangle, row by row
  for (int row = 0; row < kWaves; ++row) {
    for (int column = row; column < kWaves; ++column)
      information.push_back(row == column ? 2.0 + row : 0.01);
  }
  graph.add_factor(coefficients_type, {&a, 1}, {z.data(), kWaves}, information);
  Eigen::MatrixXd whole = Eigen::MatrixXd::Constant(kWaves, kWaves, 0.01);
  for (int row = 0; row < kWaves; ++row) whole(row, row) = 2.0 + row;
  H.topLeftCorner(kWaves, kWaves) += whole;
  g.head(kWaves) -= whole * (x - z);
  chi2 += (x - z).dot(whole * (x - z));

  const std::vector<bool> held(2, false);
  Linearizer linearizer(graph, held);
  BlockMatrix of_graph(linearizer.structure());
  Eigen::VectorXd gradient(kSize);
  const double norm = linearizer.linearize(graph.values(), of_graph, {gradient.data(), kSize});
  EXPECT_NEAR(norm, chi2, 1e-12 * chi2);
  EXPECT_LE((dense(of_graph) - H).norm(), 1e-12 * H.norm());
  EXPECT_LE((gradient - g).norm(), 1e-12 * g.norm());
}

}  // namespace
}  // namespace cairn::test
